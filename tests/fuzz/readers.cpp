#include "tests/fuzz/readers.hpp"

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <memory>
#include <optional>
#include <string>
#include <system_error>
#include <vector>

#include "diagnosis/hypotheses/place_file.hpp"
#include "diagnosis/log_columns/column_words.hpp"
#include "diagnosis/log_columns/log_recordings.hpp"
#include "diagnosis/recording_files/recording_formats.hpp"
#include "diagnosis/recording_files/time_stamp.hpp"
#include "diagnosis/recording_files/title_words.hpp"
#include "diagnosis/recording_files/written_unit.hpp"
#include "diagnosis/recordings/campaign.hpp"
#include "diagnosis/simulation/excitation_plan.hpp"
#include "problems/base/error.hpp"
#include "problems/base/units.hpp"
#include "problems/formats/csv_file.hpp"
#include "problems/formats/hdf5_file.hpp"
#include "problems/formats/mat_file.hpp"
#include "problems/formats/npy_file.hpp"
#include "problems/formats/number_table.hpp"
#include "problems/laws/expression.hpp"
#include "problems/laws/law_file.hpp"
#include "problems/mechanisms/lumped_model.hpp"
#include "problems/mechanisms/rigid_robot_model.hpp"
#include "problems/mechanisms/robot_elements.hpp"
#include "problems/mechanisms/urdf_chain.hpp"
#include "problems/robot_information/robot_grid.hpp"
#include "solvers/ellipsoid/ellipsoid.hpp"
#include "solvers/ellipsoid/ellipsoid_file.hpp"
#include "solvers/report/design_file.hpp"

namespace graybox::fuzz {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLongestRemark = 20000;

[[noreturn]] void fail(const char* problem, const std::string& message) {
  std::fprintf(stderr, "%s: %s\n", problem, message.c_str());
  std::abort();
}

// Lines of a text, as they come.
std::vector<std::string> lines_of(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

template <RecordingFile (*kRead)(const std::string&)>
void read_recording(const fs::path& file) {
  (void)kRead(file.string());
}

template <InformationSet (*kRead)(const std::string&)>
void read_set(const fs::path& file) {
  (void)kRead(file.string());
}

// The same array as matrices and as factors; one of them may be refused.
void read_npy_set(const fs::path& file) {
  try {
    (void)read_npy(file.string());
  } catch (const InputError&) {
    (void)read_npy_factors(file.string());
    return;
  }
  (void)read_npy_factors(file.string());
}

void read_mat_set(const fs::path& file) { (void)read_mat(file.string()); }

void read_hdf5_columns(const fs::path& file) {
  (void)formats::read_isolated(formats::kReadHdf5Recording, file.string());
}

void read_mat_columns(const fs::path& file) {
  (void)formats::read_isolated(formats::kReadMatRecording, file.string());
}

// The designs of the corpus are of this set: 12 candidates, d = 2.
const InformationSet& design_set() {
  static const InformationSet set = [] {
    AlignedArray information(36);
    for (std::size_t i = 0; i < 12; ++i) {
      information[3 * i] = 1.0;
      information[3 * i + 1] = 0.1 * static_cast<double>(i);
      information[3 * i + 2] = information[3 * i + 1] * information[3 * i + 1];
    }
    return InformationSet(2, std::move(information));
  }();
  return set;
}

void read_design_file(const fs::path& file) {
  // The most lenient first: what it refuses, the others refuse.
  (void)read_design(file.string(), design_set(), WeightCheck::kForChecker);
  (void)read_design(file.string(), design_set(), WeightCheck::kRepaired);
  (void)read_design(file.string(), design_set());
}

void read_table(const fs::path& file) { (void)read_number_table(file.string()); }

// The ellipsoids of the corpus are of these: the corners of a square.
void read_ellipsoid_file(const fs::path& file) {
  PointSet points;
  points.names = {"x", "y"};
  points.count = 4;
  points.dimension = 2;
  points.values = {1, 1, -1, 1, 1, -1, -1, -1};
  const EllipsoidFile found = read_ellipsoid(file.string(), points);
  (void)log_volume(found.ellipsoid);
  (void)shape_matrix(found.ellipsoid);
  (void)semi_axes(found.ellipsoid);
}

void read_robot(const fs::path& file) {
  (void)load_robot_without_elements(file);
  (void)load_linear_robot(file);
}

// As `graybox model` reads it, then as the model beside it does, which names input.urdf.
void read_urdf(const fs::path& file) {
  for (const UrdfJoint& joint : read_urdf_tree(file)) {
    (void)read_urdf_body(file, joint.child);
    try {
      (void)read_urdf_joints(file, joint.parent, joint.child);
    } catch (const InputError&) {  // a joint that can't move
    }
  }
  (void)load_robot_model(file.parent_path() / "model_of_input.yaml");
}

void read_lumped(const fs::path& file) { (void)load_lumped_model(file); }

void read_physics_file(const fs::path& file) {
  (void)load_lumped_model(file.parent_path() / "drive.yaml", file);
}

void read_robot_physics(const fs::path& file) {
  (void)load_extended_robot(file.parent_path() / "three_axis.yaml", file);
}

// The second time with a parameter to be refined, as if the user asked for it.
void read_rigid(const fs::path& file) {
  (void)rigid_robot_places(load_rigid_robot(file));
  (void)load_rigid_robot(file, {}, {"friction.reach"});
}

void read_campaign_file(const fs::path& file) { (void)read_campaign(file); }

// Also makes each law and differentiates it once.
void read_laws(const fs::path& file) {
  for (const LawEntry& entry : read_law_file(file)) {
    const std::vector<double> parameters(entry.parameters.size(), 0.5);
    const std::shared_ptr<const Law> law = entry.make(parameters);
    const std::vector<double> state(law->state_count(), 0.1);
    LawDerivatives derivatives;
    law->differentiate(0.3, -0.2, state, derivatives);
  }
}

// One formula of deflection, rate and a parameter.
void read_expression(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  const std::array<std::string, 3> names{"z", "v", "k"};
  const std::array<double, 3> values{0.3, -1.2, 2.0};
  try {
    (void)Expression(text, names).evaluate<double>(values);
  } catch (const ExpressionError&) {
  }
}

void read_places(const fs::path& file) {
  static const LumpedModel model = load_lumped_model(file.parent_path() / "drive.yaml");
  static const auto model_places = lumped_places(model, {"N m", "rad", "kg m^2"});
  std::vector<CandidatePlace> places;
  (void)add_places(file, *model_places, places);
}

// Plans of a drive and of a robot.
void read_plan_of(const fs::path& file, std::size_t joints) {
  SimulatedSystem system;
  system.sample_time = 0.001;
  system.joints = joints;
  if (joints > 0) system.frequencies = {1.0, 2.0, 5.0, 20.0};
  system.velocity_psd_slope = 0.08;
  const ExcitationPlan plan = read_plan(file, system);
  (void)planned_experiments(plan, 2);
}

void read_drive_plan(const fs::path& file) { read_plan_of(file, 0); }
void read_robot_plan(const fs::path& file) { read_plan_of(file, 6); }

void read_grid(const fs::path& file) { (void)read_positions(file, 6); }

void read_csv_columns(const fs::path& file) { (void)formats::read_csv_recording(file.string()); }
void read_json_columns(const fs::path& file) { (void)formats::read_json_recording(file.string()); }

// A stamp a line: each by itself, and all as a column.
void read_stamps(const fs::path& file) {
  constexpr double kDay = 86400.0, kLeapSecond = 1.0, kYears = 366.0 * 1e4;
  StampColumn column;
  for (const std::string& line : lines_of(file)) {
    const std::optional<TimeStamp> stamp = parse_time_stamp(line);
    if (stamp && !(stamp->seconds >= 0.0 && stamp->seconds < kDay + kLeapSecond)) {
      fail("no second of a day", line);
    }
    double seconds = 0.0;
    const bool is_taken = column.take(line, seconds);
    if (is_taken && !stamp) fail("a column takes what is no stamp", line);
    if (!(std::abs(seconds) <= kYears * kDay)) fail("no second of any year", line);
  }
  if (column.has_any()) (void)column.description();
}

// A unit a line, read alone and at the end of a title, and compared with the line before.
void read_units(const fs::path& file) {
  std::string before;
  for (const std::string& line : lines_of(file)) {
    const WrittenUnit unit = written_unit(line);
    if (!(unit.factor > 0.0) || !std::isfinite(unit.factor)) fail("no factor of a unit", line);
    if (!unit.unit.empty() && find_unit(unit.unit) == nullptr) fail("no unit that is known", line);
    if (!is_same_unit(line, line)) fail("a unit that is not itself", line);
    if (is_same_unit(line, before) != is_same_unit(before, line)) fail("one way alone", line);
    (void)unit_as_written(line);
    (void)unit_of_words(joined_words(words_of(line)));
    (void)read_column_words(line, before);
    before = line;
  }
}

// As `graybox model` reads a log: stamps, times in two columns, clocks that begin anew.
void read_log(const fs::path& file) {
  std::vector<std::string> remarks;
  for (const LogRecording& log : read_logs({file}, {}, &remarks)) {
    if (log.samples() < 1 || log.label().empty()) fail("a log without samples", log.label());
    for (const LogColumn& column : log.columns) {
      if (column.values.size() != log.samples()) fail("columns of two lengths", column.name);
    }
  }
  for (const std::string& remark : remarks) {
    if (remark.empty() || remark.size() > kLongestRemark) fail("remark", remark);
  }
}

constexpr std::array kReaders{
    Reader{"set_npy", "input.npy", &read_npy_set},
    Reader{"set_csv", "input.csv", &read_set<&read_csv>},
    Reader{"set_hdf5", "input.h5", &read_set<&read_hdf5>},
    Reader{"set_mat5", "input.mat", &read_mat_set},
    Reader{"set_mat73", "input.mat", &read_mat_set},
    Reader{"design", "input.json", &read_design_file},
    Reader{"table", "input.csv", &read_table},
    Reader{"ellipsoid", "input.json", &read_ellipsoid_file},
    Reader{"recording_csv", "input.csv", &read_csv_columns},
    Reader{"recording_npy", "input.npy", &read_recording<&formats::read_npy_recording>},
    Reader{"recording_hdf5", "input.h5", &read_hdf5_columns},
    Reader{"recording_mat", "input.mat", &read_mat_columns},
    Reader{"recording_json", "input.json", &read_json_columns},
    Reader{"log_csv", "input.csv", &read_log},
    Reader{"log_jsonl", "input.jsonl", &read_log},
    Reader{"time_stamp", "input.txt", &read_stamps},
    Reader{"written_unit", "input.txt", &read_units},
    Reader{"campaign", "input.yaml", &read_campaign_file},
    Reader{"robot_model", "input.yaml", &read_robot},
    Reader{"robot_urdf", "input.urdf", &read_urdf},
    Reader{"robot_physics", "input.yaml", &read_robot_physics},
    Reader{"lumped_model", "input.yaml", &read_lumped},
    Reader{"lumped_physics", "input.yaml", &read_physics_file},
    Reader{"rigid_robot", "input.yaml", &read_rigid},
    Reader{"law_file", "input.yaml", &read_laws},
    Reader{"expression", "input.txt", &read_expression},
    Reader{"drive_plan", "input.yaml", &read_drive_plan},
    Reader{"robot_plan", "input.yaml", &read_robot_plan},
    Reader{"places", "input.yaml", &read_places},
    Reader{"positions", "input.csv", &read_grid},
};

// A line that a person reads.
constexpr std::size_t kLongestMessage = 5000;

}  // namespace

std::span<const Reader> all_readers() { return kReaders; }

const Reader* find_reader(const std::string& name) {
  for (const Reader& reader : kReaders) {
    if (name == reader.name) return &reader;
  }
  return nullptr;
}

Workplace::Workplace(const Reader& reader) : reader_(reader) {
  std::error_code error;
  const fs::path memory = "/dev/shm";  // inputs are written a thousand times a second
  const fs::path parent = fs::is_directory(memory, error) ? memory : fs::temp_directory_path();
  std::string pattern = (parent / "graybox-fuzz-XXXXXX").string();
  if (mkdtemp(pattern.data()) == nullptr) fail("no folder can be made", pattern);
  folder_ = pattern;
  fs::copy(fs::path(GRAYBOX_FUZZ_FOLDER) / "companions", folder_);
}

Workplace::~Workplace() {
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
}

void Workplace::read(std::span<const char> bytes) const {
  const fs::path file = folder_ / reader_.input;
  {
    std::ofstream stream(file, std::ios::binary | std::ios::trunc);
    stream.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  }
  try {
    reader_.read(file);
  } catch (const InputError& error) {
    const std::string message = error.what();
    if (message.empty() || message.size() > kLongestMessage) fail("message", message);
  }
}

}  // namespace graybox::fuzz
