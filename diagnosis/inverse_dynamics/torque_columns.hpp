// The torques of a rigid robot as a linear function of its unknown parameters,
//
//   N^T u = known(q, q', q'') + columns(q, q', q'') p.
//
// The first columns are the standard inertial parameters of every link whose body is unknown (ten
// each, rigid_body_regressor.hpp). The next are the unknown rotor inertias (n_j n_j^T q'' for row
// n_j of N). The last are the parameters in which the elements' forces are linear (b_out f at the
// value one). Everything else that the model has is in `known`; but what laws with memory (states)
// add follows from all of the motion before, so that it is asked for a piece of motion at a time.
// None of their parameters has a column.
//
//   TorqueColumns columns(robot);                        // one for each thread
//   columns.carry(piece.load);                           // payloads of other loads are not there
//   columns.evaluate(q, velocity, acceleration);         // columns.matrix(), columns.known()
//   columns.remembered(piece);                           // samples x n
//
// Where the drives' gains are unknown, u_j = g_j e_j with e_j what is recorded. Each joint then has
// columns of its own for the bodies and rotors. They are 1/g_j where these are known ("1/gain_2"),
// the inertial parameters over g_j where not ("XX2/gain_1"). Links shared by several joints are not
// tied to each other, so the fit stays linear. Elements are in the unit of their joint's drive. A
// payload is a known body there: its mass has no column.
//
// Cost O(n^2) for the bodies and O(n) for each element.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <string>
#include <vector>

#include "diagnosis/inverse_dynamics/motion_record.hpp"
#include "problems/mechanisms/rigid_body_regressor.hpp"
#include "problems/mechanisms/rigid_robot_model.hpp"

namespace graybox {

class TorqueColumns {
 public:
  explicit TorqueColumns(const RigidRobotModel& robot);

  [[nodiscard]] Eigen::Index size() const { return static_cast<Eigen::Index>(names_.size()); }
  // "XX2" of link 2, "rotor_inertia_2", "friction 2.damping" of an element; inertial parameters are
  // arm-side, rotor inertias motor-side, elements as their place says.
  [[nodiscard]] const std::vector<std::string>& names() const { return names_; }
  [[nodiscard]] const std::vector<std::string>& units() const { return units_; }

  // The load of the motion that follows. Elements with a load of their own act in that one alone.
  void carry(const std::string& load) { load_ = load; }
  [[nodiscard]] const std::vector<std::string>& loads() const { return loads_; }  // of elements

  void evaluate(const Eigen::Ref<const Eigen::VectorXd>& q,
                const Eigen::Ref<const Eigen::VectorXd>& velocity,
                const Eigen::Ref<const Eigen::VectorXd>& acceleration);
  [[nodiscard]] const Eigen::MatrixXd& matrix() const { return matrix_; }  // n x size()
  [[nodiscard]] const Eigen::VectorXd& known() const { return known_; }    // n
  // N^T u of the elements with memory, which begin at rest at the first sample: samples x n. Where
  // the torques are filtered, also what the other known laws add by passing the filters.
  [[nodiscard]] Eigen::MatrixXd remembered(const Motion& piece) const;
  // What a law's column becomes by passing the filters of the torques, less what it is sample by
  // sample: along `output`. None where the torques are not filtered.
  struct FilteredColumn {
    Eigen::Index column = 0;
    Eigen::VectorXd output, change;
  };
  [[nodiscard]] std::vector<FilteredColumn> filtered_columns(const Motion& piece) const;

 private:
  // One force along `output`: of a law at z = input^T q, or `input`^T q'' if it is an inertia.
  struct Force {
    Eigen::VectorXd input, output;
    std::shared_ptr<const Law> law;  // null: inertia
    double factor = 1.0;
    Eigen::Index column = -1;  // -1: known
    std::string load = {};     // that it needs, if any
    [[nodiscard]] bool acts_with(const std::string& other) const {
      return load.empty() || load == other;
    }
  };
  // A body's torque per unit of a parameter: Y of its link times `direction`.
  struct Body {
    Eigen::Index link;
    StandardParameters direction;
    Eigen::Index column = -1;
    std::string load = {};  // that it needs, if any
  };

  [[nodiscard]] static Eigen::VectorXd change_by_filters(const Force& force, const Motion& piece);
  // Ten columns of a link whose body is unknown, in the row of one joint or in all rows.
  struct Link {
    Eigen::Index link, first;
    Eigen::Index joint = -1;  // -1: all
  };

  Eigen::Index add_column(std::string name, std::string unit);
  void add_links(const RigidRobotModel& robot);
  void add_unknown_link(Eigen::Index link);
  void add_rotors(const RigidRobotModel& robot);
  void add_gains(const RigidRobotModel& robot);
  void add_payload(const RigidRobotModel& robot, const Element& element, Eigen::Index column);
  void evaluate_links(const Eigen::MatrixXd& bodies);
  void add(const Force& force, double value);
  void add_element(const RigidRobotModel& robot, std::size_t index);
  void add_load(const std::string& load);

  RigidBodyRegressor regressor_;
  bool unknown_gains_;
  std::vector<Link> links_;  // whose columns come first, in this order
  std::vector<Body> bodies_;
  std::vector<Force> rotors_;
  std::vector<Eigen::Index> gains_;  // columns by joint, -1: none; empty where gains are known
  std::vector<Force> forces_;
  std::vector<Force> with_memory_;
  std::vector<std::string> names_, units_;
  std::string load_;
  std::vector<std::string> loads_;
  Eigen::MatrixXd matrix_;
  Eigen::VectorXd known_;
};

// "element.parameter", its unit at its place, and its value.
[[nodiscard]] std::string name_of(const RigidRobotModel& robot, const ElementParameter& place);
[[nodiscard]] std::string unit_of(const RigidRobotModel& robot, const ElementParameter& place);

// The robot with another value of one parameter of an element.
void set_parameter(RigidRobotModel& robot, const ElementParameter& place, double value);

}  // namespace graybox
