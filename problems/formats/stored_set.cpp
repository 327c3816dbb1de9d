#include "problems/formats/stored_set.hpp"

#include <utility>

#include "problems/files/input_file.hpp"
#include "problems/formats/symmetric_packer.hpp"
#include "problems/information/factor_form.hpp"

namespace graybox {
namespace {

void send(StoredNumbers numbers, MessageWriter& answer) {
  answer.whole(numbers.count);
  answer.whole(numbers.offset);
  if (numbers.offset == 0) answer.numbers(std::move(numbers.values));
}

StoredNumbers receive_numbers(ReadingProcess& child, const std::string& path) {
  StoredNumbers numbers;
  numbers.count = child.whole();
  numbers.offset = child.whole();
  if (numbers.offset == 0) {
    numbers.values = child.numbers(numbers.count);
    return numbers;
  }
  numbers.values = InputFile(path).numbers(numbers.offset, numbers.count);
  return numbers;
}

}  // namespace

// Small things first: the parent then knows the file's fields before memory is taken.
void send(StoredSet set, MessageWriter& answer) {
  answer.whole(static_cast<std::uint64_t>(ReadingStatus::kRead));
  answer.text(set.source);
  answer.whole(set.dimension);
  answer.whole(set.rank);
  answer.whole(set.first);
  answer.whole(set.total);
  answer.text(set.sha256);
  for (const auto* list : {&set.names, &set.units, &set.parameters}) answer.texts(*list);
  send(std::move(set.information), answer);
  send(std::move(set.coordinates), answer);
}

StoredSet receive_stored_set(const ReadingTask& task, const std::vector<std::string>& arguments) {
  ReadingProcess child(task, arguments);
  StoredSet set;
  set.source = child.text();
  set.dimension = child.whole();
  set.rank = child.whole();
  set.first = child.whole();
  set.total = child.whole();
  set.sha256 = child.text();
  for (auto* list : {&set.names, &set.units, &set.parameters}) *list = child.texts();
  set.information = receive_numbers(child, arguments.front());
  if (set.rank == 0) {
    require_finite(set.source, set.information.values, set.dimension);
  } else {
    require_finite_factors(set.source, set.information.values.span(), set.rank, set.dimension);
  }
  set.coordinates = receive_numbers(child, arguments.front());
  return set;
}

InformationSet information_set(const std::string& path, StoredSet stored) {
  const AlignedArray& coordinates = stored.coordinates.values;
  CandidateTable table{
      std::move(stored.names), std::move(stored.units), {coordinates.begin(), coordinates.end()}};
  if (stored.rank > 0) {
    return InformationSet::of_factors(stored.dimension, stored.rank,
                                      std::move(stored.information.values), std::move(table),
                                      std::move(stored.parameters), path);
  }
  return InformationSet(stored.dimension, std::move(stored.information.values), std::move(table),
                        std::move(stored.parameters), path);
}

}  // namespace graybox
