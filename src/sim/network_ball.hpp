#pragma once
/// A pack of balls that move as a network has it (effects/ball_network.hpp), in place of string and
/// gravity. The network knows neither cup nor contact, and nothing pulls at the arm.

#include <memory>

#include <diffnea/dynamics/string_particle.hpp>
#include <diffnea/effects/ball_network.hpp>

namespace diffnea::sim {

/// What it remembers from step to step.
template <class T>
struct NetworkBallState {
  LinkMotion<T> link;  ///< at the ball's time
  std::vector<T> hidden;
};

template <class T>
class NetworkBall {
 public:
  explicit NetworkBall(std::shared_ptr<const BallNetwork> network)
      : network_(std::move(network)), evaluate_(*network_) {}

  /// Link and ball have been at rest for as long as the cells want to see.
  void rest(NetworkBallState<T>& s, const LinkMotion<T>& link, const ParticleState<T>& ball) {
    s.link = link;
    s.hidden.assign(static_cast<std::size_t>(num_hidden(*network_)), T(0.0));
    const long steps = s.hidden.empty() ? 0 : std::lround(network_->warm_up / network_->step);
    for (long k = 0; k < steps; ++k) acceleration(s, link, ball);
  }

  /// One step, over which the link came to `end`. A ball that was `farthest` [m] from W's origin or
  /// farther stays there: its lane has failed.
  void step(NetworkBallState<T>& s, const LinkMotion<T>& end, double farthest,
            ParticleState<T>& ball) {
    const auto is_sane = dot(ball.x, ball.x) < T(farthest * farthest);
    const T h = select(is_sane, T(network_->step), T(0.0));
    const Vec3<T> a = acceleration(s, end, ball);
    ball.v = ball.v + s.link.X_WL.R * a * h;
    ball.x = ball.x + ball.v * h;
    s.link = end;
  }

 private:
  Vec3<T> acceleration(NetworkBallState<T>& s, const LinkMotion<T>& end,
                       const ParticleState<T>& ball) {
    T input[kNetworkInputs];
    network_input(s.link, end, network_->step, ball.x, ball.v, input);
    return evaluate_(input, s.hidden.data());
  }

  std::shared_ptr<const BallNetwork> network_;
  NetworkEvaluator<T> evaluate_;
};

}  // namespace diffnea::sim
