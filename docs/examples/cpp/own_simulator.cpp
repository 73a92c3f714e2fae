/// A simulator of one's own, and a policy that is learned in it: a cart on a rail whose drive
/// slips, so that it lags behind what is asked of it.
///
///     own_simulator

#include <cmath>
#include <cstdio>
#include <exception>

#include <diffnea/core/error.hpp>
#include <diffnea/policy/ereps.hpp>
#include <diffnea/policy/rollouts.hpp>

namespace {

using diffnea::Lanes;
using diffnea::VecX;

class SlippingCart : public diffnea::Simulator {
 public:
  static constexpr double kPeriod = 0.01, kSlip = 0.15;  // [s]

  const std::vector<std::string>& joints() const override { return joints_; }
  const std::vector<std::string>& channels() const override { return channels_; }
  double period() const override { return kPeriod; }
  int lanes() const override { return kLanes; }

  void reset(const diffnea::Starts& starts) override {
    const long n = starts.q.cols();
    diffnea::require_size("SlippingCart: rows of the starts", starts.q.rows(), 1, "joint");
    if (n < 1 || n > kLanes)
      throw diffnea::ShapeError("SlippingCart: got " + std::to_string(n) +
                                " starts, expected 1 to " + std::to_string(kLanes));
    seen_ = Lanes::Zero(2, kLanes);
    seen_.row(0).head(n) = starts.q.row(0);
  }
  void step(const Lanes& q, const Lanes&) override {
    seen_.row(1) = (q.row(0) - seen_.row(0)) / kSlip;
    seen_.row(0) += kPeriod * seen_.row(1);
  }
  const Lanes& observe() const override { return seen_; }
  const std::vector<std::string>& failures() const override { return failures_; }
  std::unique_ptr<diffnea::Simulator> clone() const override {
    return std::make_unique<SlippingCart>(*this);
  }

 private:
  static constexpr int kLanes = 16;
  std::vector<std::string> joints_{"cart"}, channels_{"q_cart", "qd_cart"}, failures_;
  Lanes seen_ = Lanes::Zero(2, kLanes);
};

/// The cart ends at 0.5 m, at rest.
class Arrive : public diffnea::Task {
 public:
  void begin(const diffnea::Simulator& simulator, int count) override {
    q_ = diffnea::find_channel(simulator, "q_cart");
    qd_ = diffnea::find_channel(simulator, "qd_cart");
    lost_ = VecX<double>::Zero(count);
  }
  void look(double, const Lanes& seen, std::vector<char>&) override {
    const long n = lost_.size();
    lost_ = ((seen.row(q_).head(n).array() - 0.5).abs() + 0.1 * seen.row(qd_).head(n).array().abs())
                .matrix()
                .transpose();
  }
  VecX<double> rewards() const override { return -lost_; }
  std::unique_ptr<diffnea::Task> clone() const override { return std::make_unique<Arrive>(*this); }

 private:
  int q_ = 0, qd_ = 0;
  VecX<double> lost_;
};

}  // namespace

int main() try {
  const diffnea::Promp promp({.joints = {"cart"},
                              .bases = 6,
                              .held_first = 1,
                              .held_last = 0,
                              .duration = 1.0,
                              .hold = 0.3,
                              .returns = false});
  const VecX<double> home = VecX<double>::Zero(1), any = VecX<double>::Constant(1, 1e9);
  diffnea::Rollouts rollouts(SlippingCart(), Arrive(), promp, home, {-any, any, any});
  const int d = promp.size();
  diffnea::Ereps search({VecX<double>::Zero(d), 0.25 * diffnea::MatX<double>::Identity(d, d)},
                        {.samples = 40, .stop_std = 0.002}, /*seed=*/1);
  while (!search.done()) search.tell(rollouts.run(search.ask()).rewards);
  const diffnea::RolloutTrace trace = rollouts.trace(search.policy().mean);
  std::printf("after %d iterations the cart arrives within %.1f mm\n", search.iteration(),
              1e3 * -trace.reward);
  return -trace.reward < 0.02 ? 0 : 3;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
