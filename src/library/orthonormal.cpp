#include "library/orthonormal.hpp"

#include <Eigen/QR>
#include <pendula/numeric/directions.hpp>

namespace pendula {

void make_orthonormal(double* directions, std::ptrdiff_t rows, std::ptrdiff_t count, double* lengths) {
  Eigen::Map<Directions<>> columns(directions, rows, count);
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(columns);
  Eigen::Map<Eigen::VectorXd>(lengths, count) = qr.matrixQR().diagonal().cwiseAbs();
  columns = qr.householderQ() * Eigen::MatrixXd::Identity(rows, count);
}

}  // namespace pendula
