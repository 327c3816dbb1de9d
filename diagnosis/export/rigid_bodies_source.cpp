#include "diagnosis/export/rigid_bodies_source.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <vector>

#include "diagnosis/export/law_source.hpp"
#include "problems/mechanisms/rigid_body_regressor.hpp"

namespace graybox {
namespace {

using Eigen::Index;

std::string list_of(const std::vector<double>& values) {
  std::vector<std::string> texts;
  texts.reserve(values.size());
  for (const double value : values) texts.push_back(c_number(value));
  return fmt::format("{{{}}}", fmt::join(texts, ", "));
}

std::vector<double> by_rows(const Eigen::MatrixXd& matrix) {
  std::vector<double> values;
  for (Index i = 0; i < matrix.rows(); ++i) {
    for (Index j = 0; j < matrix.cols(); ++j) values.push_back(matrix(i, j));
  }
  return values;
}

// One table with a row for each joint.
template <typename RowOf>
std::string table(const ExportedModel& model, const std::string& comment, const std::string& name,
                  int columns, const RowOf& row_of) {
  std::string text = fmt::format("/* {} */\nstatic const double {}[{}][{}] = {{\n", comment, name,
                                 model.size(), columns);
  for (Index j = 0; j < model.size(); ++j) text += fmt::format("    {},\n", list_of(row_of(j)));
  return text + "};\n";
}

std::string tables(const ExportedModel& model) {
  const auto joint = [&](Index j) -> const RobotJoint& {
    return model.robot->joints[static_cast<std::size_t>(j)];
  };
  std::string text =
      table(model, "Each joint's frame in that before at position 0: axes, by rows.",
            "origin_rotation", 9, [&](Index j) { return by_rows(joint(j).origin.linear()); }) +
      table(model, "Its origin, m.", "origin", 3,
            [&](Index j) { return by_rows(joint(j).origin.translation().transpose()); }) +
      table(model, "The axis about which it turns or along which it slides.", "axis", 3,
            [&](Index j) { return by_rows(joint(j).axis.transpose()); });
  text += fmt::format("static const int slides[{}] = {{", model.size());
  for (Index j = 0; j < model.size(); ++j) {
    text += fmt::format("{}{}", j == 0 ? "" : ", ", joint(j).is_prismatic ? 1 : 0);
  }
  text += "};\n";
  text += table(model,
                "Its body, about the frame's origin: XX, XY, XZ, YY, YZ, ZZ [kg m^2], mass times "
                "centre\n * of mass x, y, z [kg m], mass [kg].",
                "body", 10, [&](Index j) { return by_rows(model.bodies.col(j).transpose()); });
  return text + fmt::format("static const double gravity[3] = {}; /* m/s^2 */\n\n",
                            list_of(by_rows(model.robot->gravity.transpose())));
}

constexpr const char* kVectors =
    R"(static void cross(const double a[3], const double b[3], double product[3]) {
  product[0] = a[1] * b[2] - a[2] * b[1];
  product[1] = a[2] * b[0] - a[0] * b[2];
  product[2] = a[0] * b[1] - a[1] * b[0];
}

static double dot(const double a[3], const double b[3]) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* r v of a matrix by rows. */
static void turn(const double r[9], const double v[3], double turned[3]) {
  int i;
  for (i = 0; i < 3; ++i) turned[i] = r[3 * i] * v[0] + r[3 * i + 1] * v[1] + r[3 * i + 2] * v[2];
}

/* v becomes r^T v. */
static void turn_back(const double r[9], double v[3]) {
  const double x = v[0], y = v[1], z = v[2];
  int i;
  for (i = 0; i < 3; ++i) v[i] = r[i] * x + r[3 + i] * y + r[6 + i] * z;
}

/* Where the frame of joint j stands in that before. */
static void frame(int j, double q, double rotation[9], double place[3]) {
  const double *o = origin_rotation[j], *a = axis[j];
  double about[9], shift[3];
  int i, k;
  for (i = 0; i < 9; ++i) rotation[i] = o[i];
  for (i = 0; i < 3; ++i) place[i] = origin[j][i];
  if (slides[j]) {
    turn(o, a, shift);
    for (i = 0; i < 3; ++i) place[i] += q * shift[i];
    return;
  }
  { /* Rodrigues */
    const double c = cos(q), s = sin(q), d = 1.0 - cos(q);
    about[0] = c + d * a[0] * a[0];
    about[1] = d * a[0] * a[1] - s * a[2];
    about[2] = d * a[0] * a[2] + s * a[1];
    about[3] = d * a[1] * a[0] + s * a[2];
    about[4] = c + d * a[1] * a[1];
    about[5] = d * a[1] * a[2] - s * a[0];
    about[6] = d * a[2] * a[0] - s * a[1];
    about[7] = d * a[2] * a[1] + s * a[0];
    about[8] = c + d * a[2] * a[2];
  }
  for (i = 0; i < 3; ++i) {
    for (k = 0; k < 3; ++k) {
      rotation[3 * i + k] =
          o[3 * i] * about[k] + o[3 * i + 1] * about[3 + k] + o[3 * i + 2] * about[6 + k];
    }
  }
}

/* Force and moment about its origin that a body's motion takes: p its ten parameters, w and dw its
 * rotation, a the acceleration of its origin. */
static void wrench(const double p[10], const double w[3], const double dw[3], const double a[3],
                   double push[3], double moment[3]) {
  const double matrix[9] = {p[0], p[1], p[2], p[1], p[3], p[4], p[2], p[4], p[5]};
  const double *h = p + 6;
  double t[3], u[3], iw[3], idw[3];
  int i;
  cross(w, h, t);
  cross(w, t, u);
  cross(dw, h, t);
  for (i = 0; i < 3; ++i) push[i] = p[9] * a[i] + t[i] + u[i];
  turn(matrix, w, iw);
  turn(matrix, dw, idw);
  cross(w, iw, t);
  cross(h, a, u);
  for (i = 0; i < 3; ++i) moment[i] = idw[i] + t[i] + u[i];
}

)";

// {0}: the number of joints, {1}: the last.
constexpr const char* kRecursion =
    R"(static void rigid_bodies(const double position[{0}], const double velocity[{0}],
    const double acceleration[{0}], double force[{0}]) {{
  double rotation[{0}][9], place[{0}][3], push[{0}][3], moment[{0}][3];
  double w[3] = {{0.0, 0.0, 0.0}}, dw[3] = {{0.0, 0.0, 0.0}};
  double a[3] = {{-gravity[0], -gravity[1], -gravity[2]}};
  double carried_push[3] = {{0.0, 0.0, 0.0}}, carried_moment[3] = {{0.0, 0.0, 0.0}};
  double t[3], u[3], v[3];
  int i, j;
  for (j = 0; j < {0}; ++j) {{ /* outwards: the motion of each frame, in its own axes */
    frame(j, position[j], rotation[j], place[j]);
    cross(dw, place[j], t);
    cross(w, place[j], u);
    cross(w, u, v);
    for (i = 0; i < 3; ++i) a[i] += t[i] + v[i];
    turn_back(rotation[j], w);
    turn_back(rotation[j], dw);
    turn_back(rotation[j], a);
    cross(w, axis[j], t);
    for (i = 0; i < 3; ++i) {{
      if (slides[j]) {{
        a[i] += 2.0 * velocity[j] * t[i] + acceleration[j] * axis[j][i];
      }} else {{
        dw[i] += velocity[j] * t[i] + acceleration[j] * axis[j][i];
        w[i] += velocity[j] * axis[j][i];
      }}
    }}
    wrench(body[j], w, dw, a, push[j], moment[j]);
  }}
  for (j = {1}; j >= 0; --j) {{ /* inwards: what each joint carries */
    for (i = 0; i < 3; ++i) {{
      push[j][i] += carried_push[i];
      moment[j][i] += carried_moment[i];
    }}
    force[j] = dot(axis[j], slides[j] ? push[j] : moment[j]);
    turn(rotation[j], push[j], carried_push);
    turn(rotation[j], moment[j], carried_moment);
    cross(place[j], carried_push, t);
    for (i = 0; i < 3; ++i) carried_moment[i] += t[i];
  }}
}}

)";

}  // namespace

std::string rigid_bodies_source(const ExportedModel& model) {
  return tables(model) + kVectors +
         fmt::format(fmt::runtime(kRecursion), model.size(), model.size() - 1);
}

}  // namespace graybox
