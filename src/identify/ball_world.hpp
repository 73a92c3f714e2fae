#pragma once
/// The world of one window in any scalar: hand, forces, view.

#include <array>

#include <diffnea/effects/catalogue.hpp>
#include <diffnea/identify/ball_fit.hpp>

namespace diffnea {

/// Derivatives included.
inline bool identical(double a, double b) { return a == b; }
template <class T, int N>
bool identical(const ceres::Jet<T, N>& a, const ceres::Jet<T, N>& b) {
  return a.a == b.a && a.v == b.v;
}

/// Of one thread: it keeps the last motions of its anchor.
/// @tparam T  double, or a Jet with respect to parameters and first state
template <Scalar T>
struct BallWorld {
  const Model* model = nullptr;
  const BallLayout* layout = nullptr;
  const HandMotion* hand = nullptr;
  std::vector<T> p;  ///< as the layout's parameters
  Vec3<T> p_LS;
  T r{};
  bool needs_jerk = false;           ///< an effect asks for the anchor's
  std::optional<Pose<double>> X_LC;  ///< of the cup, where it may bar the string

  BallWorld(const Model& m, const BallLayout& l, const HandMotion& h, std::vector<T> parameters)
      : model(&m), layout(&l), hand(&h), p(std::move(parameters)) {
    if (!m.ball->string) return;
    r = T(m.ball->string->length);
    p_LS = m.ball->string->p_LS.template cast<T>();
    for (std::size_t k = 0; k < p.size(); ++k) {
      const BallParameter& parameter = l.parameters[k];
      if (parameter.effect >= 0) continue;
      T& held = parameter.index == 0   ? r
                : parameter.index == 1 ? p_LS.x
                : parameter.index == 2 ? p_LS.y
                                       : p_LS.z;
      held = p[k];
    }
    each_effect([&](const auto& formula, const T* values) {
      needs_jerk = needs_jerk || formula.info().has(Trait::kReadsAnchorJerk);
      if constexpr (requires { formula.add_to_anchor(values, p_LS); })
        formula.add_to_anchor(values, p_LS);
      if constexpr (requires(CupPosition<T> h) { formula.route(h, h, *m.cup, values); })
        X_LC = cup_at_string(m);
    });
  }

  bool has_string() const { return model->ball->string.has_value(); }
  T length() const { return r; }
  AnchorMotion<T> anchor(const T& time) const {
    for (const Known& k : known_)  // a step asks six times for it, of three instants
      if (k.is_set && identical(k.time, time)) return k.anchor;
    newest_ = 1 - newest_;
    known_[newest_] = {true, time, hand->anchor(time, p_LS)};
    return known_[newest_].anchor;
  }
  /// From where on the string of a ball at x is free.
  FreeString<T> string(const T& time, const Vec3<T>& x) const {
    if (!X_LC) return {anchor(time), r};
    using std::sqrt;
    constexpr double kOnAxis = 1e-12;  // [m²]: there, any half plane is one
    const Pose<T> X_WL = hand->pose(time);
    const Vec3<T> b = transpose_times(X_LC->R, transpose_times(X_WL.R, x - X_WL.p) - X_LC->p);
    const Vec3<T> k = transpose_times(X_LC->R, p_LS - X_LC->p);
    const T radius = sqrt(b.x * b.x + b.y * b.y + T(kOnAxis)), cos = b.x / radius,
            sin = b.y / radius;
    StringRoute<T> route{};
    each_effect([&](const auto& formula, const T* values) {
      const CupPosition<T> ball{b.z, radius}, knot{k.z, k.x * cos + k.y * sin};
      if constexpr (requires { formula.route(ball, knot, *model->cup, values); })
        route = formula.route(ball, knot, *model->cup, values);
    });
    if (!(value(route.used) > 0.0)) return {anchor(time), r};
    const Vec3<T> edge{route.edge.radius * cos, route.edge.radius * sin, route.edge.height};
    return {hand->anchor(time, X_LC->R * edge + X_LC->p), r - route.used};
  }
  /// Restitution as it becomes taut.
  T rebound() const {
    T out(0.0);
    each_effect([&](const auto& formula, const T* values) {
      if constexpr (requires { formula.rebound(values); }) out = formula.rebound(values);
    });
    return out;
  }

  Vec3<T> acceleration(const BallSample<T>& x) const {
    const BallInstant<T> full = completed(x);
    Vec3<T> a = model->gravity.template cast<T>();
    each_effect([&](const auto& formula, const T* values) {
      if constexpr (requires { formula.add_acceleration(full, values, a); })
        formula.add_acceleration(full, values, a);
    });
    return a;
  }

  /// Over the plane that the ball bounces off, if there is one.
  T clearance(const ParticleState<T>& s) const {
    T out(kFarAway);
    each_effect([&](const auto& formula, const T* values) {
      if constexpr (requires { formula.clearance(s, 0.0, values); })
        out = formula.clearance(s, model->ball->radius, values);
    });
    return out;
  }
  void bounce(ParticleState<T>& s, Vec3<T>& spin) const {
    each_effect([&](const auto& formula, const T* values) {
      if constexpr (requires { formula.bounce(values, 0.0, s, spin); })
        formula.bounce(values, model->ball->radius, s, spin);
    });
  }

  /// How late the camera's picture is [s].
  T delay() const {
    T out(0.0);
    each_effect([&](const auto& formula, const T* values) {
      if constexpr (requires { formula.delay(values); }) out = out + formula.delay(values);
    });
    return out;
  }

  /// Where the camera sees the ball.
  Vec3<T> seen(const BallFlight<T, BallWorld>& flight) const {
    BallInstant<T> x = completed(flight.sample());
    Vec3<T> out = x.ball.x;
    for (const ViewStage stage : kViewStages)
      each_effect([&](const auto& formula, const T* values) {
        if constexpr (requires { formula.change_view(x, values, out); })
          if (formula.info().view == stage) formula.change_view(x, values, out);
      });
    return out;
  }

 private:
  struct Known {
    bool is_set = false;
    T time{};
    AnchorMotion<T> anchor{};
  };
  mutable std::array<Known, 2> known_;
  mutable std::size_t newest_ = 0;

  static constexpr double kFarAway = 1e3;    ///< where there is no plane [m]
  static constexpr double kJerkStep = 5e-3;  ///< of the difference [s]

  BallInstant<T> completed(const BallSample<T>& sample) const {
    BallInstant<T> x;
    static_cast<BallSample<T>&>(x) = sample;
    x.gravity = model->gravity;
    x.mass = model->ball->mass;
    x.radius = model->ball->radius;
    if (x.taut && needs_jerk) {
      const T late = x.time + T(kJerkStep), early = x.time - T(kJerkStep);
      x.anchor_jerk = (anchor(late).a - anchor(early).a) * T(0.5 / kJerkStep);
    }
    return x;
  }
  template <class Visit>
  void each_effect(const Visit& visit) const {
    std::size_t k = 0;
    while (k < p.size() && layout->parameters[k].effect < 0) ++k;
    for (const BoundEffect& e : layout->effects) {
      visit_formula(e, [&](const auto& formula) { visit(formula, p.data() + k); });
      k += e.parameters.size();
    }
  }
};

/// The camera's view of one window, `each(k, seen, flight)` row by row, in any scalar.
template <class T, class Each>
void fly(const BallWorld<T>& world, const BallWindow& window, const ParticleState<T>& state,
         const FlightOptions& options, const Each& each) {
  BallFlight<T, BallWorld<T>> flight(world, options);
  const T late = world.delay();  // the first state is of the first picture
  flight.start(T(window.time.front()) - late, state, window.taut, window.spin.template cast<T>());
  for (std::size_t k = 0; k < window.time.size(); ++k) {
    flight.run_until(T(window.time[k]) - late);
    each(k, world.seen(flight), flight);
  }
}

}  // namespace diffnea
