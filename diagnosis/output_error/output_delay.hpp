// Outputs that come late: y(t) becomes y(t - tau), with the derivatives of y taken along and its
// own by tau, -y'(t - tau). Between samples y is the cubic through its four nearest ones. Before
// the first sample it is held at its value there, as delayed inputs are (node_inputs.hpp).
#pragma once

#include <Eigen/Core>
#include <vector>

#include "diagnosis/output_error/lumped_system.hpp"

namespace graybox {

// `outputs`: samples * outputs rows, sample by sample, [value, tangents]. `delays`: s, of each
// output; `columns`: of their tangents, 0 where a delay is known. At least four samples, at rising
// times.
void delay_outputs(const Eigen::Ref<const Eigen::VectorXd>& time, const Eigen::VectorXd& delays,
                   const std::vector<Eigen::Index>& columns, Rows& outputs);

}  // namespace graybox
