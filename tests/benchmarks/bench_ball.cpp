/// Time of a ball's dynamics and of its fit: `make bench`. Wall-clock medians of several runs.

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <functional>
#include <vector>

#include "identify/ball_world.hpp"
#include "support/camera_ball.hpp"

using namespace diffnea;

namespace {

constexpr int kRounds = 9;

double median_seconds(const std::function<void()>& call) {
  std::vector<double> out;
  for (int k = 0; k < kRounds; ++k) {
    const auto start = std::chrono::steady_clock::now();
    call();
    out.push_back(std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  std::ranges::sort(out);
  return out[kRounds / 2];
}

/// Microseconds of one call, in which `sum` keeps the compiler from leaving it out.
template <class Call>
double microseconds(const Call& call) {
  constexpr int kCalls = 100000;
  double sum = 0.0;
  const double seconds = median_seconds([&] {
    for (int k = 0; k < kCalls; ++k) sum += call(k);
  });
  if (sum == 0.123) std::printf(" ");
  return 1e6 * seconds / kCalls;
}

const std::vector<EffectSpec> kDrag{{"linear_drag", "ball", {}}};

void bench_acceleration() {
  static_assert(kJetWidth == 8);
  const Model model = test::swinging_arm();
  const BallLayout layout = make_ball_layout(model, kDrag);
  const Recording r = test::record_swing(model, {.seconds = 4.0, .drag = 0.1});
  const BallData data = make_ball_data(model, {r}, {});
  std::vector<JetD> p;
  for (std::size_t k = 0; k < layout.parameters.size(); ++k)
    p.emplace_back(layout.parameters[k].value, static_cast<int>(k));
  const BallWorld<JetD> world(model, layout, data.hands.front(), p);
  BallSample<JetD> x;
  x.time = JetD(1.0);
  x.taut = true;
  x.anchor = world.anchor(x.time);
  x.u = {JetD(0.6, 5), JetD(0.0, 6), JetD(-0.8, 7)};
  x.ball = {x.anchor.x + x.u * world.length(), {JetD(0.3), JetD(0.2), JetD(0.1)}};
  const StringSmoothing smoothing;
  const double smooth = microseconds([&](int k) {
    x.ball.v.x.a = 1e-6 * k;
    return string_acceleration(x.ball, x.anchor, world.acceleration(x), world.length(), smoothing)
        .x.a;
  });
  const double forces = microseconds([&](int k) {
    x.ball.v.x.a = 1e-6 * k;
    return world.acceleration(x).x.a;
  });
  const double anchor =
      microseconds([&](int k) { return world.anchor(JetD(1.0 + 1e-6 * k)).x.x.a; });
  BallFlight<JetD, BallWorld<JetD>> flight(world, {.step = 1e-2});
  constexpr int kSteps = 200;
  const double second = median_seconds([&] {
    flight.start(1.0, x.ball, true);
    flight.run_until(1.0 + 0.01 * kSteps - 1e-9);
  });
  std::printf("\nA taut ball on a moving hand, linear drag, Jets of 8 parameters\n");
  std::printf("  forces and string_acceleration %7.3f us   (target 1)\n", smooth);
  std::printf("  forces alone                   %7.3f us\n", forces);
  std::printf("  anchor's motion                %7.3f us\n", anchor);
  std::printf("  one slope of a step            %7.3f us   (Runge-Kutta 4, all of it; target 1)\n",
              1e6 * second / (4 * kSteps));
}

void bench_fit() {
  Model nominal = test::swinging_arm();
  const Recording r = test::record_swing(nominal, {.seconds = 40.0, .drag = 0.1});
  nominal.ball->string->length = 0.2;
  // Four of the string, six of effects.
  const std::vector<EffectSpec> effects{{"linear_drag", "ball", {}},
                                        {"string_mass", "string", {}},
                                        {"camera_delay", "camera", {}},
                                        {"wind", "ball", {}}};
  BallFit fit;
  std::size_t parameters = 0;
  const double seconds = median_seconds([&] {
    Model model = nominal;
    BallData data = make_ball_data(model, {r}, {});
    guess_string(data, model.ball->string->p_LS, model.ball->string->length);
    const BallLayout layout = make_ball_layout(model, effects);
    parameters = layout.parameters.size();
    fit = fit_ball(model, layout, data);
  });
  std::printf("\nFit of a ball on a string, 40 s at 100 Hz, %zu parameters, one thread\n",
              parameters);
  std::printf("  total                          %7.2f s    (target 2)\n", seconds);
  std::printf("  %s after %d steps; r = %.4f m (0.4), noise %.2f mm (1.5)\n",
              fit.termination.c_str(), fit.iterations, fit.p[0], 1e3 * fit.sigma);
}

}  // namespace

int main() {
  bench_acceleration();
  std::fflush(stdout);
  bench_fit();
}
