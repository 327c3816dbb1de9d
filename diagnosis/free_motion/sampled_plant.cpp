#include "diagnosis/free_motion/sampled_plant.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <unsupported/Eigen/MatrixFunctions>

namespace graybox {
namespace {

using Complex = std::complex<double>;
using Eigen::Index;
using Eigen::MatrixXcd;
using Eigen::MatrixXd;
using Eigen::VectorXcd;

}  // namespace

MatrixXcd SampledPlant::sight(Complex z) const {
  MatrixXcd matrix = -triangle;
  matrix.diagonal().array() += z;
  return matrix.triangularView<Eigen::Upper>().solve<Eigen::OnTheRight>(output);
}

MatrixXcd SampledPlant::response(Complex z) const { return sight(z) * input; }

VectorXcd SampledPlant::state(Complex z, const VectorXcd& g) const {
  MatrixXcd matrix = -triangle;
  matrix.diagonal().array() += z;
  return vectors * matrix.triangularView<Eigen::Upper>().solve(g);
}

SampledPlant sampled_plant(const LinearPlant& plant, double sample_time) {
  const Index n = plant.mass.rows(), inputs = plant.input.cols();
  const Eigen::PartialPivLU<MatrixXd> mass(plant.mass);  // laws between places leave it unsymmetric
  MatrixXd block = MatrixXd::Zero(2 * n + inputs, 2 * n + inputs);
  block.block(0, n, n, n).setIdentity();
  block.block(n, 0, n, n) = -mass.solve(plant.stiffness);
  block.block(n, n, n, n) = -mass.solve(plant.damping);
  block.block(n, 2 * n, n, inputs) = mass.solve(plant.input);
  const MatrixXd exponential = (block * sample_time).exp();
  const Eigen::ComplexSchur<MatrixXd> schur(exponential.topLeftCorner(2 * n, 2 * n));
  SampledPlant result;
  result.vectors = schur.matrixU();
  result.triangle = schur.matrixT();
  result.input = schur.matrixU().adjoint() * exponential.topRightCorner(2 * n, inputs);
  MatrixXd output(plant.position_output.rows(), 2 * n);
  output << plant.position_output, plant.velocity_output;
  result.output = output * schur.matrixU();
  return result;
}

}  // namespace graybox
