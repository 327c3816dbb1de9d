#include "diagnosis/recording_files/title_words.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <utility>

namespace graybox {
namespace {

// Signs and the letters that stand for them, in UTF-8 but for the last.
constexpr auto kSigns = std::to_array<std::pair<std::string_view, std::string_view>>({
    {"\xE2\x80\xB0", " permille "},
    {"\xC2\xB0", " deg "},  // degree sign
    {"\xC2\xBA", " deg "},  // the ordinal o, which keyboards have in its place
    {"\xCB\x9A", " deg "},  // a ring
    {"\xC2\xB5", "u"},      // micro sign
    {"\xCE\xBC", "u"},      // mu
    {"\xCF\x89", "omega"},
    {"\xCE\xB8", "theta"},
    {"\xCF\x91", "theta"},
    {"\xCF\x86", "phi"},
    {"\xCF\x95", "phi"},
    {"\xCF\x88", "psi"},
    {"\xCF\x84", "tau"},
    {"\xE1\xBA\x8B", "x dot"},
    {"\xCC\x87", " dot"},   // a dot above the letter before it
    {"\xC2\xB2", "2"},      // squared
    {"\xC2\xB9", "1"},      // superscript one
    {"\xE2\x81\xBB", "-"},  // superscript minus
    {"\xE2\x88\x92", "-"},  // minus
    {"\xC3\xA4", "ae"},
    {"\xC3\xB6", "oe"},
    {"\xC3\xBC", "ue"},
    {"\xC3\x84", "Ae"},
    {"\xC3\x96", "Oe"},
    {"\xC3\x9C", "Ue"},
    {"\xC3\x9F", "ss"},
    {"\xC3\xA0", "a"},
    {"\xC3\xA1", "a"},
    {"\xC3\xA7", "c"},
    {"\xC3\xA8", "e"},
    {"\xC3\xA9", "e"},
    {"\xC3\x89", "E"},
    {"\xC3\xAA", "e"},
    {"\xC3\xAD", "i"},
    {"\xC3\xB2", "o"},
    {"\xC3\xB3", "o"},
    {"\xC3\xB1", "n"},
    {"\xC3\xB9", "u"},
    {"\xC3\xBA", "u"},
    {"\xC3\x81", "A"},
    {"\xB0", " deg "},  // degree sign, Latin 1
});

// The bytes that begin a text and are one letter in UTF-8; 0 where they are none.
std::size_t letter_of_utf8(std::string_view text) {
  const auto first = static_cast<unsigned char>(text.front());
  const std::size_t bytes = first < 0x80           ? 1
                            : first >> 5U == 0x6U  ? 2
                            : first >> 4U == 0xEU  ? 3
                            : first >> 3U == 0x1EU ? 4
                                                   : 0;
  if (bytes == 0 || bytes > text.size()) return 0;
  for (std::size_t k = 1; k < bytes; ++k) {
    if (static_cast<unsigned char>(text[k]) >> 6U != 0x2U) return 0;
  }
  return bytes;
}

bool is_utf8(std::string_view text) {
  while (!text.empty()) {
    const std::size_t bytes = letter_of_utf8(text);
    if (bytes == 0) return false;
    text.remove_prefix(bytes);
  }
  return true;
}

}  // namespace

std::string in_utf8(std::string_view text) {
  if (is_utf8(text)) return std::string(text);
  std::string result;
  for (const char c : text) {
    const auto letter = static_cast<unsigned char>(c);
    if (letter >= 0x80) result += static_cast<char>(0xC0U | letter >> 6U);
    result += static_cast<char>(letter < 0x80 ? letter : 0x80U | (letter & 0x3FU));
  }
  return result;
}

void replace_all(std::string& text, std::string_view from, std::string_view to) {
  std::string result;
  std::size_t begin = 0;
  for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, begin)) {
    result.append(text, begin, at - begin).append(to);
    begin = at + from.size();
  }
  result.append(text, begin);
  text = std::move(result);
}

std::string spelled_out(std::string_view text) {
  std::string result(text);
  const bool is_plain =
      std::ranges::all_of(text, [](char c) { return static_cast<unsigned char>(c) < 0x80; });
  if (is_plain) return result;
  for (const auto& [sign, letters] : kSigns) replace_all(result, sign, letters);
  return result;
}

std::vector<std::string> words_as_written(std::string_view title) {
  std::vector<std::string> words;
  std::string word;
  const auto close = [&] {
    if (!word.empty()) words.push_back(word);
    word.clear();
  };
  unsigned char before = ' ';
  for (const char each : title) {
    const auto c = static_cast<unsigned char>(each);
    const bool breaks = (std::isdigit(c) != 0) != (std::isdigit(before) != 0) ||
                        (std::isupper(c) != 0 && std::islower(before) != 0);
    if (std::isalnum(c) == 0 || breaks) close();
    if (std::isalnum(c) != 0) word += each;
    before = c;
  }
  close();
  return words;
}

std::vector<std::string> in_lower_case(std::vector<std::string> words) {
  for (std::string& word : words) {
    std::ranges::transform(word, word.begin(),
                           [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  }
  return words;
}

std::vector<std::string> words_of(std::string_view title) {
  return in_lower_case(words_as_written(spelled_out(title)));
}

std::string joined_words(std::span<const std::string> words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : " ") + word;
  return text;
}

}  // namespace graybox
