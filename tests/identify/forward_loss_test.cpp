/// The forward loss: its rows against the forward dynamics themselves, and identify() against the
/// loss that it claims to minimise (paper, eq. 2).

#include <cmath>
#include <support/wam_study.hpp>

#include <catch2/catch_test_macros.hpp>

#include <diffnea/effects/forward_dynamics.hpp>
#include <diffnea/identify/identify.hpp>
#include <diffnea/identify/torque_regression.hpp>

#include "support/found.hpp"

namespace forward_loss_test {

using namespace diffnea;

namespace {

const test::WamDraw& draw() {
  static const test::WamDraw kDraw = test::draw_wam(300, 20.0);
  return kDraw;
}

FitLayout layout_of(const Model& model) { return make_layout(model, FitChoice{}, {0}); }

VecX<double> shapes_of(const FitLayout& layout) {
  VecX<double> out(static_cast<long>(layout.shape.size()));
  for (long s = 0; s < out.size(); ++s) out[s] = layout.shape[static_cast<std::size_t>(s)].prior;
  return out;
}

TorqueRegression regress(const FitLayout& layout, const PreprocessPlan& plan, const VecX<double>& x,
                         double rest_speed = 0.0) {
  RegressionOptions options;
  options.acceleration = true;
  options.rest_speed = rest_speed;
  TorqueRegression out(draw().nominal, layout, plan, {x, shapes_of(layout)}, options);
  out.add(preprocess(draw().train, plan));
  return out;
}

/// Residual of the rows of joint j at x.
VecX<double> residual(const TorqueRegression& of, int j, const VecX<double>& x) {
  const auto rows = of.kept()[static_cast<std::size_t>(j)].rows();
  return rows.leftCols(rows.cols() - 1) * x - rows.rightCols(1);
}

}  // namespace

TEST_CASE("forward loss: rows leave the error of the forward dynamics", "[identify]") {
  const FitLayout layout = layout_of(draw().nominal);
  const PreprocessPlan plan = plan_preprocess({draw().train});
  const VecX<double> x = layout.prior();
  const TorqueRegression rows = regress(layout, plan, x);

  const Preprocessed block = preprocess(draw().train, plan);
  ForwardDynamics dynamics(extend(draw().nominal));
  RowMatX<double> error = block.qdd;
  for (long k = 0; k < block.rows(); ++k) {
    VecX<double> qdd(error.cols());
    dynamics.acceleration(block.q.row(k).data(), block.qd.row(k).data(), block.tau.row(k).data(), 0,
                          qdd.data());
    error.row(k) -= qdd.transpose();
  }
  Decimator decimator(plan.decimator);
  const RowMatX<double> expected = decimator.push(error);
  for (int j = 0; j < layout.num_dofs; ++j) {
    const VecX<double> got = residual(rows, j, x);
    REQUIRE(got.size() == expected.rows());
    // M⁻¹ amplifies rounding by its condition number, some 1e4.
    CHECK((got - expected.col(j)).norm() < 1e-9 * expected.col(j).norm());
  }
}

TEST_CASE("forward loss: columns are derivatives, that of M⁻¹ included", "[identify]") {
  const FitLayout layout = layout_of(draw().nominal);
  const PreprocessPlan plan = plan_preprocess({draw().train});
  VecX<double> x = layout.prior();  // inside the bounds: friction may not be negative
  for (long c = 0; c < x.size(); ++c)
    if (layout.linear[static_cast<std::size_t>(c)].effect >= 0) x[c] += 0.05;
  const TorqueRegression rows = regress(layout, plan, x);
  for (long c = 0; c < x.size(); ++c) {
    const double step = 1e-5 * std::max(std::abs(x[c]), 0.1);
    const VecX<double> more = x + step * VecX<double>::Unit(x.size(), c),
                       less = x - step * VecX<double>::Unit(x.size(), c);
    const TorqueRegression above = regress(layout, plan, more), below = regress(layout, plan, less);
    for (int j = 0; j < layout.num_dofs; ++j) {
      const VecX<double> expected =
          (residual(above, j, more) - residual(below, j, less)) / (2.0 * step);
      const VecX<double> got = rows.kept()[static_cast<std::size_t>(j)].rows().col(c);
      CAPTURE(layout.linear[static_cast<std::size_t>(c)].name, j);
      CHECK((got - expected).norm() < 1e-5 * (expected.norm() + 1e-3 * std::sqrt(got.size())));
    }
  }
}

TEST_CASE("forward loss: no step of a parameter lowers it", "[identify]") {
  IdentifyOptions options;
  options.loss = Loss::kForward;
  const IdentifyResult result = identify(draw().nominal, {draw().train}, {}, options);
  REQUIRE(result.summary.converged);
  const FitLayout layout = layout_of(draw().nominal);
  VecX<double> x(static_cast<long>(layout.linear.size()));
  for (long c = 0; c < x.size(); ++c)
    x[c] = test::find(result, layout.linear[static_cast<std::size_t>(c)].name).value;
  // The joints' noise unknown: Σ n_j ln σ_j is what the reweighted fit minimises.
  const auto loss = [&](const VecX<double>& at) {
    const TorqueRegression rows = regress(layout, result.plan, at, RegressionOptions{}.rest_speed);
    double sum = 0.0;
    for (const JointFactor& f : rows.factors())
      sum += static_cast<double>(f.factor.rows()) * std::log(f.rmse(at));
    return sum;
  };
  const double least = loss(x);
  int tried = 0;
  for (long c = 0; c < x.size(); ++c) {
    const ParameterEstimate& p =
        test::find(result, layout.linear[static_cast<std::size_t>(c)].name);
    if (p.fixed || !p.identifiable || p.at_bound) continue;
    ++tried;
    // Far beyond the fit's own tolerance, a hundredth of this, and near enough to see its slope.
    for (const double step : {-0.2, 0.2}) {
      VecX<double> moved = x;
      moved[c] += step * p.std;
      CAPTURE(p.name, step);
      CHECK(loss(moved) > least);
    }
  }
  CHECK(tried > 8);
}

}  // namespace forward_loss_test
