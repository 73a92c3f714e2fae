#include <diffnea/core/error.hpp>
#include <diffnea/identify/constrained_loss.hpp>

namespace diffnea {
namespace {

/// The motion of a body with its smoothed turn and place, and their two derivatives, as variables:
/// numbers `first` and on of kPerBody. Places are in the body's smoothed axes.
void vary(BodyState<JetD>& state, Twist<JetD>& acceleration, int first) {
  const auto variable = [first](int at) {
    const auto one = [&](int k) {
      return k >= first && k < first + kJetWidth ? JetD(0.0, k - first) : JetD(0.0);
    };
    return Vec3<JetD>{one(at), one(at + 1), one(at + 2)};
  };
  const Vec3<JetD> spin = state.V.angular, v = state.V.linear,
                   a = acceleration.linear + cross(spin, v);
  const Mat3<JetD> turn = exp(variable(9));
  state.X_WB.p = state.X_WB.p + state.X_WB.R * variable(0);
  state.X_WB.R = state.X_WB.R * turn;
  state.V.angular = spin + variable(12);
  state.V.linear = transpose_times(turn, v + variable(3));
  acceleration.angular = acceleration.angular + variable(15);
  acceleration.linear =
      transpose_times(turn, a + variable(6)) - cross(state.V.angular, state.V.linear);
}

template <class T>
ConstrainedSystem<T> system_at(
    const std::function<void(const BodySample&, const VecX<T>&, ConstrainedSystem<T>&)>& fill,
    const BodySample& sample, const VecX<T>& p, const MotionVariables& variables) {
  ConstrainedSystem<T> out;
  for (const BodyState<double>& s : sample.states)
    out.states.push_back({s.X_WB.template cast<T>(),
                          {s.V.angular.template cast<T>(), s.V.linear.template cast<T>()}});
  for (const Twist<double>& a : sample.accelerations)
    out.accelerations.push_back({a.angular.template cast<T>(), a.linear.template cast<T>()});
  if constexpr (std::is_same_v<T, JetD>)
    if (variables.body >= 0)
      vary(out.states[static_cast<std::size_t>(variables.body)],
           out.accelerations[static_cast<std::size_t>(variables.body)], variables.first);
  const Vec3<T> zero{T(0.0), T(0.0), T(0.0)};
  out.applied.assign(sample.states.size(), {zero, zero});
  fill(sample, p, out);
  require_size("constrained loss: bodies of the system", static_cast<long>(out.bodies.size()),
               static_cast<long>(sample.states.size()), "body of the motion");
  return out;
}

}  // namespace

ConstrainedSystem<double> ConstrainedModel::at(const BodySample& sample,
                                               const VecX<double>& p) const {
  return system_at(plain_, sample, p, {});
}
ConstrainedSystem<JetD> ConstrainedModel::at(const BodySample& sample, const VecX<JetD>& p,
                                             const MotionVariables& variables) const {
  return system_at(jets_, sample, p, variables);
}

}  // namespace diffnea
