/// A task of one's own, learned in a model: carry a ball that hangs on a string 0.2 m to the side,
/// so that it does not swing when the arm has arrived.
///
///     own_task MODEL       a robot with a ball on a string and a frame `cup`, e.g. wam4_ball.xml

#include <cstdio>
#include <exception>

#include <diffnea/io/model_file.hpp>
#include <diffnea/policy/ereps.hpp>
#include <diffnea/policy/rollouts.hpp>
#include <diffnea/sim/model_simulator.hpp>

namespace {

using diffnea::Lanes;
using diffnea::VecX;

/// Less is lost the nearer the cup is to where it should be at the end, and the slower the ball.
class CarryStill : public diffnea::Task {
 public:
  static constexpr double kAside = 0.2;  // [m]

  void begin(const diffnea::Simulator& simulator, int count) override {
    cup_ = diffnea::find_channel(simulator, "cup_y");
    ball_ = diffnea::find_channel(simulator, "ball_vx");
    start_.resize(0);
    last_ = VecX<double>::Zero(count);
  }
  void look(double, const Lanes& seen, std::vector<char>&) override {
    const long n = last_.size();
    if (start_.size() == 0) start_ = seen.row(cup_).head(n).transpose();
    const VecX<double> aside = seen.row(cup_).head(n).transpose() - start_;
    const VecX<double> speed = seen.middleRows(ball_, 3).leftCols(n).colwise().norm().transpose();
    last_ = (10.0 * (aside.array() - kAside).abs() + speed.array()).matrix();
  }
  VecX<double> rewards() const override { return -last_; }
  std::unique_ptr<diffnea::Task> clone() const override {
    return std::make_unique<CarryStill>(*this);
  }

 private:
  int cup_ = 0, ball_ = 0;
  VecX<double> start_, last_;
};

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 2) {
    std::fprintf(stderr, "usage: %s MODEL\n", argv[0]);
    return 2;
  }
  const diffnea::Model model = diffnea::read_model(argv[1]);
  const diffnea::ModelSimulator world({model}, model);
  const VecX<double> home =
      Eigen::Map<const VecX<double>>(model.home.data(), world.joints().size());
  const VecX<double> any = VecX<double>::Constant(home.size(), 1e9);
  const diffnea::Promp promp({.joints = {world.joints().front()},
                              .bases = 6,
                              .held_first = 1,
                              .held_last = 0,
                              .duration = 1.0,
                              .hold = 0.2,
                              .returns = false});
  diffnea::Rollouts rollouts(world, CarryStill(), promp, home, {-any, any, any}, /*threads=*/2);

  const int d = promp.size();
  diffnea::Ereps search({VecX<double>::Zero(d), 0.09 * diffnea::MatX<double>::Identity(d, d)},
                        {.samples = 40, .stop_std = 0.003}, /*seed=*/1);
  while (!search.done()) search.tell(rollouts.run(search.ask()).rewards);

  const diffnea::RolloutTrace trace = rollouts.trace(search.policy().mean);
  std::printf(
      "after %d iterations: lost %.4f (10 times the cup's error [m] and the ball's speed [m/s])\n",
      search.iteration(), -trace.reward);
  return -trace.reward < 0.05 ? 0 : 3;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
