/// Standard errors of fits to simulated windows against fits that leave blocks of time out.

#include <cmath>
#include <limits>

#include <catch2/catch_approx.hpp>
#include <catch2/catch_test_macros.hpp>
#include <catch2/generators/catch_generators.hpp>

#include "identify/motion_fit.hpp"
#include "motion/free_swing.hpp"

namespace motion_errors_test {

using namespace diffnea;
using Catch::Approx;

namespace {

/// A pendulum with viscous friction alone, fitted to a swing.
class Swing {
 public:
  Swing(const test::FreeSwing& truth, double horizon) : model_(test::swing_model()) {
    model_.effects = {{"viscous_friction", "pendulum", {{"viscous", 1e-4, ""}}}};
    const Recording data = free_swing(truth, test::even_times(0.0, 20.0, 100.0));
    noise_ = sensor_noise({data}, {true});
    stretches_ = motion_stretches(data, noise_, {true});
    windows_ = cut_windows(stretches_, horizon);
    set_measured_states(stretches_, 0.1, windows_);
    FitChoice choice;
    choice.fit = {"effects"};
    choice.effects = std::vector<std::string>{};
    layout_ = make_layout(model_, choice, {0});
  }

  /// Leaves rows [first, first + rows) out of the fit.
  void leave_out(long first, long rows) {
    stretches_[0].q.middleRows(first, rows).setConstant(std::numeric_limits<double>::quiet_NaN());
  }
  const std::vector<MotionWindow>& windows() const { return windows_; }

  MotionFit fit() {
    const MotionProblem problem{model_, layout_,         stretches_,
                                {0},    noise_.position, layout_.prior().cwiseAbs().cwiseMax(1e-4)};
    MotionFitter fitter(problem, {}, layout_.prior(), VecX<double>(0));
    std::vector<MotionWindow> windows = windows_;
    fitter.fit(windows, 1e-9);
    fitter.set_covariance(windows);
    return fitter.now();
  }
  /// Column of the friction.
  long column() const {
    for (std::size_t c = 0; c < layout_.linear.size(); ++c)
      if (!layout_.linear[c].fixed) return static_cast<long>(c);
    return -1;
  }

 private:
  Model model_;
  SensorNoise noise_;
  std::vector<MotionStretch> stretches_;
  std::vector<MotionWindow> windows_;
  FitLayout layout_;
};

/// Standard error by noise alone.
double by_noise(const MotionFit& fit, long column) { return 1.0 / fit.R.col(column).norm(); }

}  // namespace

TEST_CASE("motion errors: as fits differ that leave out a block of time each", "[identify]") {
  // Dry friction and drag are no viscous one: what is left of them hangs together.
  const test::FreeSwing truth{.coulomb = 4e-4, .quadratic = 3e-5};
  const double horizon = GENERATE(20.0, 7.0, 0.5);  // parts of one window, of three, windows
  CAPTURE(horizon);
  Swing whole(truth, horizon);
  const long c = whole.column();
  const MotionFit fit = whole.fit();
  const std::size_t windows = whole.windows().size(), each = (20 + windows - 1) / windows;
  double spread = 0.0, blocks = 0.0;
  for (const MotionWindow& w : whole.windows())
    for (std::size_t b = 0; b < each; ++b, blocks += 1.0) {
      // Row k is of part k · each / rows.
      const auto begin = [&](std::size_t part) {
        return (static_cast<long>(part) * w.rows + static_cast<long>(each) - 1) /
               static_cast<long>(each);
      };
      Swing rest(truth, horizon);
      rest.leave_out(w.first + begin(b), begin(b + 1) - begin(b));
      spread += std::pow(rest.fit().x[c] - fit.x[c], 2);
    }
  const double expected =
      std::sqrt(spread * (blocks - 1.0) / blocks * (blocks - 1.0) / (blocks - 3.0));
  // One Gauss–Newton step in the place of a fit: off by 0.13 % at most.
  CHECK(std::sqrt(fit.covariance(c, c)) == Approx(expected).epsilon(0.01));
  CHECK(expected > 2.0 * by_noise(fit, c));
}

TEST_CASE("motion errors: of white noise alone they are those of independent rows", "[identify]") {
  Swing swing({.coulomb = 0.0, .quadratic = 0.0, .viscous = 1e-4}, GENERATE(20.0, 0.5));
  const MotionFit fit = swing.fit();
  const long c = swing.column();
  const double ratio = std::sqrt(fit.covariance(c, c)) / by_noise(fit, c);
  CHECK(ratio > 0.99);  // but for the weak prior
  CHECK(ratio < 1.5);   // 20 blocks tell a spread to 16 %: three of that
}

}  // namespace motion_errors_test
