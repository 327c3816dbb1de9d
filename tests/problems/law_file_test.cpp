// Laws that users define by formulas in files.
#include "problems/laws/law_file.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "problems/laws/expression.hpp"
#include "problems/laws/law_catalogue.hpp"
#include "problems/mechanisms/lumped_model.hpp"
#include "tests/support/refusal.hpp"
#include "tests/support/temporary_folder.hpp"

namespace graybox {
namespace {

const std::vector<std::string> kNames{"z", "v", "k"};

double value_of(const std::string& text, std::vector<double> values = {0.7, -0.3, 2.5}) {
  return Expression(text, kNames).evaluate<double>(values);
}

TEST(Expression, FollowsTheRulesOfArithmetic) {
  const double z = 0.7, v = -0.3, k = 2.5;
  EXPECT_DOUBLE_EQ(value_of("1 + 2 * 3 - 4 / 8"), 6.5);
  EXPECT_DOUBLE_EQ(value_of("8 - 3 - 2"), 3.0);
  EXPECT_DOUBLE_EQ(value_of("8 / 4 / 2"), 1.0);
  EXPECT_DOUBLE_EQ(value_of("2 ^ 3 ^ 2"), 512.0);
  EXPECT_DOUBLE_EQ(value_of("-z^2"), -z * z);
  EXPECT_DOUBLE_EQ(value_of("(-z)^2"), z * z);
  EXPECT_DOUBLE_EQ(value_of("v^3"), v * v * v);
  EXPECT_DOUBLE_EQ(value_of("v^-2"), 1.0 / (v * v));
  EXPECT_DOUBLE_EQ(value_of("z^0.5 * k ^ z"), std::sqrt(z) * std::pow(k, z));
  EXPECT_DOUBLE_EQ(value_of("1.5e2*z"), 150.0 * z);
  EXPECT_DOUBLE_EQ(value_of("2 * -v"), 0.6);
  EXPECT_DOUBLE_EQ(value_of("k*min(z, v) + max(abs(v), sign(v))"), k * v - v);
  EXPECT_DOUBLE_EQ(value_of("sin(pi/6) + cos(z) - tan(z)"), 0.5 + std::cos(z) - std::tan(z));
  EXPECT_DOUBLE_EQ(value_of("exp(log(k)) + tanh(v) + sqrt(z)"), k + std::tanh(v) + std::sqrt(z));
  EXPECT_DOUBLE_EQ(value_of("asin(z)+acos(z)+atan(z)"), std::numbers::pi / 2 + std::atan(z));
  EXPECT_DOUBLE_EQ(value_of("cosh(z)^2 - sinh(z)^2"), 1.0);
}

TEST(Expression, SaysWhatIsWrongAndWhere) {
  for (const auto& [text, complaint] : std::vector<std::pair<std::string, std::string>>{
           {"", "ends too early"},
           {"z +", "ends too early"},
           {"z * (k + 1", "')' is missing"},
           {"z * q", "character 5: 'q' is neither"},
           {"foo(z)", "no function 'foo'"},
           {"min(z)", "',' is missing"},
           {"z k", "character 3: 'k' is not expected"},
           {"z ** 2", "'*' is not expected"},
           {"2 $ 3", "'$' is not expected"},
           {std::string(200, '(') + "z" + std::string(200, ')'), "nested too deeply"},
           {std::string(200, '-') + "z", "nested too deeply"}}) {
    try {
      (void)Expression(text, kNames);
      ADD_FAILURE() << text;
    } catch (const ExpressionError& error) {
      EXPECT_NE(std::string(error.what()).find(complaint), std::string::npos) << error.what();
    }
  }
}

const std::string kHead = "format: graybox-laws/1\nlaws:\n";
const std::string kMagnet = R"(  - name: magnet
    description: repelling magnets
    force: k * z^5 + c * z^2 * v
    parameters: {k: {unit: F/x^5, range: positive}, c: {unit: F*s/x^3}}
)";
const std::string kFading = R"(  - name: fading_friction
    description: friction with one state
    states: {s: v * (1 - s * sign(v) / reach)}
    force: level * s / reach
    parameters:
      level: {unit: F, range: positive}
      reach: {unit: x, range: positive, tried: deflection}
)";

class LawFile : public ::testing::Test {
 protected:
  std::vector<std::string> add(const std::string& laws) {
    testing::write_text(folder_.file("laws.yaml"), kHead + laws);
    return add_law_file(folder_.file("laws.yaml"));
  }
  testing::TemporaryFolder folder_;
};

TEST_F(LawFile, AddsLawsWithTheirDerivatives) {
  EXPECT_EQ(add(kMagnet + kFading), (std::vector<std::string>{"magnet", "fading_friction"}));
  const LawEntry& magnet = *find_law("magnet", false);
  const auto law = magnet.make(std::vector<double>{3.0, 0.5});
  EXPECT_DOUBLE_EQ(law->force(-0.4, 1.2, {}), 3.0 * std::pow(-0.4, 5) + 0.5 * 0.16 * 1.2);
  LawDerivatives found;
  law->differentiate(-0.4, 1.2, {}, found);
  EXPECT_DOUBLE_EQ(found.force.by_deflection, 15.0 * std::pow(0.4, 4) - 0.5 * 0.8 * 1.2);
  EXPECT_DOUBLE_EQ(found.force.by_rate, 0.5 * 0.16);
  EXPECT_DOUBLE_EQ(found.force.by_parameter[0], std::pow(-0.4, 5));
  EXPECT_DOUBLE_EQ(found.force.by_parameter[1], 0.16 * 1.2);
  EXPECT_TRUE(magnet.parameters[0].is_linear);
  EXPECT_TRUE(magnet.parameters[1].is_linear);
}

// Of a product the first factor is the amplitude, the other is tried.
TEST_F(LawFile, FindsTheAmplitudes) {
  add(R"(  - name: product
    description: two factors
    force: size * share * tanh(v / width)
    parameters:
      size: {unit: F, range: positive}
      share: {unit: "1", tried: [0.5, 1]}
      width: {unit: x/s, tried: rate}
)");
  const LawEntry& product = *find_law("product", false);
  EXPECT_TRUE(product.parameters[0].is_linear);
  EXPECT_FALSE(product.parameters[1].is_linear);
  EXPECT_FALSE(product.parameters[2].is_linear);
  EXPECT_EQ(product.parameters[1].trials.values, (std::vector<double>{0.5, 1.0}));
  EXPECT_FALSE(product.parameters[2].trials.rate_shares.empty());
}

// The same law as graybox's own, where both know it.
TEST_F(LawFile, StatesMoveAsThoseOfTheCatalogue) {
  add(kFading);
  const LawEntry& fading = *find_law("fading_friction", false);
  EXPECT_TRUE(fading.parameters[0].is_linear);
  EXPECT_FALSE(fading.parameters[1].is_linear);
  const auto ours = fading.make(std::vector<double>{4.0, 0.02});
  const auto dahl = find_law("dahl", false)->make(std::vector<double>{200.0, 4.0});
  ASSERT_EQ(ours->state_count(), 1U);
  std::vector<double> mine{0.0}, theirs(dahl->state_count(), 0.0), rate{0.0}, other_rate = theirs;
  for (int step = 0; step < 4000; ++step) {
    const double t = 0.001 * step, z = 0.05 * std::sin(3.0 * t), v = 0.15 * std::cos(3.0 * t);
    EXPECT_NEAR(ours->force(z, v, mine), dahl->force(z, v, theirs), 1e-9);
    ours->state_rate(z, v, mine, rate);
    dahl->state_rate(z, v, theirs, other_rate);
    EXPECT_NEAR(ours->state_rate_and_slope(z, v, mine[0]).value, rate[0], 1e-12);
    EXPECT_NEAR(ours->state_rate_and_slope(z, v, mine[0]).by_state,
                dahl->state_rate_and_slope(z, v, theirs[0]).by_state, 1e-9);
    mine[0] += 0.001 * rate[0];
    theirs[0] += 0.001 * other_rate[0];
  }
}

TEST_F(LawFile, LawsMayStandInTheModel) {
  const std::string model = R"(format: graybox-lumped/1
sample_time: 0.001
motion: translation
masses: {carriage: 2}
laws:
)" + kMagnet + R"(elements:
  - name: end stop
    location: {kind: element, mass: carriage}
    law: magnet
    parameters: {k: {value: 4, unit: N/m^5}, c: {value: 0.1, unit: N*s/m^3}}
inputs: [{name: force, mass: carriage}]
outputs: [{name: speed, mass: carriage, quantity: velocity}]
)";
  testing::write_text(folder_.file("model.yaml"), model);
  const LumpedModel loaded = load_lumped_model(folder_.file("model.yaml"));
  ASSERT_EQ(loaded.elements.size(), 1U);
  EXPECT_DOUBLE_EQ(loaded.elements[0].law->force(0.5, 0.0, {}), 4.0 / 32.0);
  // Read again, and from a file of laws: the same definition.
  EXPECT_NO_THROW((void)load_lumped_model(folder_.file("model.yaml")));
  EXPECT_NO_THROW(add(kMagnet));
  std::string other = kMagnet;
  other.replace(other.find("z^5"), 3, "z^7");
  testing::expect_refused([&] { add(other); }, "name of another law");
}

TEST_F(LawFile, RefusesWhatItCannotUse) {
  const auto replaced = [](std::string text, const std::string& from, const std::string& to) {
    return text.replace(text.find(from), from.size(), to);
  };
  for (const auto& [laws, complaint] : std::vector<std::pair<std::string, std::string>>{
           {replaced(kMagnet, "magnet", "coulomb"), "a law of graybox's own"},
           {replaced(kMagnet, "magnet", "two words"), "letters, digits"},
           {replaced(kMagnet, "k * z^5", "q * z^5"), "'q' is neither"},
           {replaced(kMagnet, "k * z^5", "k^2 * z^5"), "tried"},
           {replaced(kMagnet, "k * z^5 + c * z^2 * v", "z^5 * k + c*v + 1"), "tried"},
           {replaced(kMagnet, "{k: {unit: F/x^5, range: positive}, c: {unit: F*s/x^3}}",
                     "{k: {unit: F, tried: [1]}, c: {unit: F, tried: speed}}"),
            "must be one of deflection, rate"},
           {replaced(kMagnet, "range: positive", "range: large"), "must be one of"},
           {replaced(kMagnet, "c: {unit", "z: {unit"), "name that is taken"},
           {replaced(kFading, "{s: v", "{z: v"), "must be new"},
           {replaced(kFading, "{s: v * (1", "{s: v * (w"), "'w' is neither"}}) {
    testing::expect_refused([&, text = laws] { add(text); }, complaint);
  }
  testing::expect_refused([&] { (void)add_law_file(folder_.file("none.yaml")); }, "none.yaml");
}

}  // namespace
}  // namespace graybox
