#include <catch2/catch_approx.hpp>
#include <catch2/catch_test_macros.hpp>

#include <diffnea/core/error.hpp>
#include <diffnea/core/random.hpp>
#include <diffnea/core/triangular_factor.hpp>

namespace triangular_factor_test {

using namespace diffnea;
using Catch::Approx;

namespace {

/// Householder QR of 5000 rows of order 1 loses some ten bits: 1e-13 observed, 10² of margin.
constexpr double kQrTol = 1e-11;

RowMatX<double> random_rows(Rng& rng, long rows, long cols) {
  RowMatX<double> m(rows, cols);
  for (long i = 0; i < m.size(); ++i) m.data()[i] = rng.normal();
  return m;
}

}  // namespace

TEST_CASE("triangular factor: keeps the sum of squares of every parameter vector", "[identify]") {
  Rng rng(1);
  const int p = 7;
  const RowMatX<double> rows = random_rows(rng, 5000, p + 1);
  TriangularFactor factor(p);
  for (long at = 0; at < rows.rows(); at += 333)
    factor.add(rows.middleRows(at, std::min(333L, rows.rows() - at)));
  CHECK(factor.rows() == 5000);
  for (int trial = 0; trial < 5; ++trial) {
    VecX<double> pi(p);
    for (int k = 0; k < p; ++k) pi[k] = rng.normal();
    const double direct = (rows.leftCols(p) * pi - rows.col(p)).squaredNorm();
    CHECK(factor.sum_of_squares(pi) == Approx(direct).epsilon(kQrTol));
    CHECK((factor.R() * pi - factor.d()).squaredNorm() + factor.residual_sum_of_squares() ==
          Approx(direct).epsilon(kQrTol));
  }
}

TEST_CASE("triangular factor: factors of parts combine to the factor of the whole", "[identify]") {
  Rng rng(2);
  const int p = 5;
  const RowMatX<double> rows = random_rows(rng, 3000, p + 1);
  TriangularFactor whole(p), first(p), second(p);
  whole.add(rows);
  first.add(rows.topRows(1234));
  second.add(rows.bottomRows(3000 - 1234));
  first.add(second);
  CHECK(first.rows() == whole.rows());
  const MatX<double> a = first.R().transpose() * first.R();
  const MatX<double> b = whole.R().transpose() * whole.R();
  CHECK((a - b).norm() < kQrTol * b.norm());
}

TEST_CASE("triangular factor: fewer rows than columns is no special case", "[identify]") {
  Rng rng(3);
  TriangularFactor factor(6);
  const RowMatX<double> rows = random_rows(rng, 3, 7);
  factor.add(rows);
  const VecX<double> pi = VecX<double>::Ones(6);
  const double direct = (rows.leftCols(6) * pi - rows.col(6)).squaredNorm();
  CHECK((factor.R() * pi - factor.d()).squaredNorm() + factor.residual_sum_of_squares() ==
        Approx(direct).epsilon(kQrTol));
  CHECK_THROWS_AS(factor.add(random_rows(rng, 1, 6)), ShapeError);
}

}  // namespace triangular_factor_test
