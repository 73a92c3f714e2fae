#pragma once
/// Catch2 matcher: every entry equal to within an absolute tolerance; says which entry is worst.

#include <sstream>

#include <Eigen/Core>
#include <catch2/matchers/catch_matchers_templated.hpp>

namespace diffnea::test {

class MatrixNear : public Catch::Matchers::MatcherGenericBase {
 public:
  template <class Derived>
  MatrixNear(const Eigen::MatrixBase<Derived>& expected, double tolerance)
      : expected_(expected), tolerance_(tolerance) {}

  template <class Derived>
  bool match(const Eigen::MatrixBase<Derived>& actual) const {
    const Eigen::MatrixXd a = actual;
    std::ostringstream out;
    if (a.rows() != expected_.rows() || a.cols() != expected_.cols()) {
      out << "has shape " << expected_.rows() << "x" << expected_.cols();
      words_ = out.str();
      return false;
    }
    Eigen::Index row = 0, col = 0;
    // NaN fails: it compares false with anything.
    const Eigen::MatrixXd difference = (a - expected_).cwiseAbs();
    const bool finite = difference.allFinite();
    const double worst = difference.size() == 0 ? 0.0 : difference.maxCoeff(&row, &col);
    if (difference.size() > 0)
      out << "equals within " << tolerance_ << "; worst at (" << row << ", " << col
          << "): " << a(row, col) << " against " << expected_(row, col) << ", off by " << worst;
    words_ = out.str();
    return finite && worst <= tolerance_;
  }
  std::string describe() const override { return words_; }

 private:
  Eigen::MatrixXd expected_;
  double tolerance_;
  mutable std::string words_;
};

}  // namespace diffnea::test
