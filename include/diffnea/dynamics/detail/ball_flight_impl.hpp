#pragma once

#include <cmath>

#include <diffnea/dynamics/ball_flight.hpp>

namespace diffnea {

namespace detail {

/// What rounding leaves of h where the string is tight [m²].
inline constexpr double kTight = 1e-12;

/// Where f, at most 0 at 0 and above 0 at `after`, comes above 0: a point where it has, no further
/// behind than 2^-40 of the bracket. A secant's pace where f is smooth, one step more than
/// bisection at worst (ITP: Oliveira and Takahashi 2020, algorithm 1).
/// @param y_before, y_after  f(0), f(after)
template <class F>
double first_above(const F& f, double y_before, double y_after, double after) {
  constexpr int kHalvings = 40;  // of some ms, until rounding
  constexpr double kTruncation = 0.2;
  const double whole = after;
  double before = 0.0, allowed = whole;  // twice the width that is due after this step
  for (int i = 0; i <= kHalvings && after - before > std::ldexp(whole, -kHalvings); ++i) {
    const double width = after - before, middle = 0.5 * (before + after);
    double at = middle;
    if (y_before <= 0.0) {
      const double secant = before + width * (y_before / (y_before - y_after));
      const double inward = middle > secant ? 1.0 : -1.0;
      const double more =  // past it, so that both ends close in; by more than rounding
          std::max(kTruncation * width * width / whole, std::ldexp(whole, -kHalvings - 2));
      at = more < std::abs(middle - secant) ? secant + inward * more : middle;
      const double most = std::max(allowed - 0.5 * width, 0.0);
      if (std::abs(at - middle) > most) at = middle - inward * most;
    }
    allowed *= 0.5;
    const double y = f(at);
    (y > 0.0 ? after : before) = at;
    (y > 0.0 ? y_after : y_before) = y;
  }
  return after;
}

}  // namespace detail

template <Scalar T, class World>
BallFlight<T, World>::BallFlight(const World& world, const FlightOptions& options)
    : world_(world), options_(options) {
  if (world_.has_string() && !(value(world_.length()) > 0.0))
    throw ModelError("string: got a length of " + std::to_string(value(world_.length())) +
                     " m, expected a positive one");
}

template <Scalar T, class World>
void BallFlight<T, World>::start(const T& time, const ParticleState<T>& state, bool taut,
                                 const Vec3<T>& spin) {
  time_ = time;
  state_ = state;
  spin_ = spin;
  taut_ = false;
  if (world_.has_string() && (taut || value(excess(time_, state)) > -detail::kTight)) become_taut();
  impacts_ = 0;
  lost_energy_ = T(0.0);
}

template <Scalar T, class World>
T BallFlight<T, World>::excess(const T& time, const ParticleState<T>& s) const {
  const FreeString<T> string = string_at(time, s.x);
  const Vec3<T> delta = s.x - string.anchor.x;
  return dot(delta, delta) - string.length * string.length;
}

template <Scalar T, class World>
FreeString<T> BallFlight<T, World>::string_at(const T& time, const Vec3<T>& x) const {
  if constexpr (requires { world_.string(time, x); })
    return world_.string(time, x);
  else
    return {world_.anchor(time), world_.length()};
}

template <Scalar T, class World>
BallSample<T> BallFlight<T, World>::sample(const T& time, const ParticleState<T>& s,
                                           bool taut) const {
  BallSample<T> out;
  out.time = time;
  out.ball = s;
  out.taut = taut;
  out.spin = spin_;
  if (world_.has_string()) {
    const FreeString<T> string = string_at(time, s.x);
    out.anchor = string.anchor;
    out.length = string.length;
    const Vec3<T> delta = s.x - out.anchor.x;
    const T distance = norm(delta);
    // A ball that has slipped through its anchor has no direction.
    out.u = value(distance) > 0.0 ? delta * (T(1.0) / distance) : Vec3<T>{};
  }
  return out;
}

template <Scalar T, class World>
T BallFlight<T, World>::taut_pull(const T& time, const ParticleState<T>& s) const {
  const BallSample<T> x = sample(time, s, true);
  const Vec3<T> delta = s.x - x.anchor.x, delta_d = s.v - x.anchor.v;
  return dot(x.u, world_.acceleration(x) - x.anchor.a) + dot(delta_d, delta_d) / norm(delta);
}

template <Scalar T, class World>
T BallFlight<T, World>::pull() const {
  return taut_ ? taut_pull(time_, state_) : T(0.0);
}

template <Scalar T, class World>
T BallFlight<T, World>::over(const T& time, const ParticleState<T>& s) const {
  if (taut_) return -taut_pull(time, s);
  const T stretch = world_.has_string() ? excess(time, s) - T(detail::kTight) : T(-1.0);
  const T deep = depth(s);
  return value(deep) > value(stretch) ? deep : stretch;
}

template <Scalar T, class World>
T BallFlight<T, World>::depth(const ParticleState<T>& s) const {
  if constexpr (requires { world_.clearance(s); })
    if (!taut_) return -world_.clearance(s) - T(detail::kTight);
  return T(-1.0);
}

/// On the sphere, without velocity along the string.
template <Scalar T, class World>
void BallFlight<T, World>::settle(ParticleState<T>& s, const T& time) const {
  const BallSample<T> x = sample(time, s, true);
  s.x = x.anchor.x + x.u * x.length;
  s.v = s.v - x.u * dot(x.u, s.v - x.anchor.v);
}

template <Scalar T, class World>
ParticleState<T> BallFlight<T, World>::moved(const T& h) const {
  const auto slope = [&](const T& at, const ParticleState<T>& s) -> ParticleState<T> {
    const BallSample<T> x = sample(at, s, taut_);
    const Vec3<T> a = world_.acceleration(x);
    if (!taut_) return {s.v, a};
    const Vec3<T> delta = s.x - x.anchor.x, delta_d = s.v - x.anchor.v;
    return {s.v,
            a - delta * ((dot(delta, a - x.anchor.a) + dot(delta_d, delta_d)) / dot(delta, delta))};
  };
  const auto plus = [](const ParticleState<T>& s, const ParticleState<T>& d, const T& t) {
    return ParticleState<T>{s.x + d.x * t, s.v + d.v * t};
  };
  const T half = h * T(0.5), sixth = h * T(1.0 / 6.0), third = h * T(1.0 / 3.0);
  const ParticleState<T> k1 = slope(time_, state_),
                         k2 = slope(time_ + half, plus(state_, k1, half)),
                         k3 = slope(time_ + half, plus(state_, k2, half)),
                         k4 = slope(time_ + h, plus(state_, k3, h));
  ParticleState<T> out = plus(plus(plus(plus(state_, k1, sixth), k2, third), k3, third), k4, sixth);
  if (taut_) settle(out, time_ + h);
  return out;
}

/// Share of a step in which the phase ends: bracketed by the values, then one step of the implicit
/// function theorem for the derivatives.
template <Scalar T, class World>
T BallFlight<T, World>::time_to_end(double h, double over_after) const {
  const double after =
      detail::first_above([&](double t) { return value(over(time_ + T(t), moved(T(t)))); },
                          value(over(time_, state_)), over_after, h);
  if constexpr (std::same_as<T, double>) {
    return after;
  } else {
    const auto at = [&](double t) { return over(time_ + T(t), moved(T(t))); };
    const double d = 1e-6;
    const double rate = (value(at(after + d)) - value(at(after - d))) / (2 * d);
    const T end = at(after);
    return T(after) - (end - T(value(end))) / T(rate);
  }
}

template <Scalar T, class World>
void BallFlight<T, World>::become_taut() {
  const auto [anchor, length] = string_at(time_, state_.x);
  const Vec3<T> delta = state_.x - anchor.x, u = delta * (T(1.0) / norm(delta));
  const T outward = dot(u, state_.v - anchor.v);
  state_.x = anchor.x + u * length;
  if (value(outward) < options_.rest_speed && value(taut_pull(time_, state_)) < 0.0) {
    // On its way in. What still leads outward would bring it back here without end.
    if (value(outward) > 0.0) state_.v = state_.v - u * outward;
    return;
  }
  ++impacts_;
  T restitution(options_.restitution);
  if constexpr (requires { world_.rebound(); }) restitution = world_.rebound();
  const bool is_impact = value(outward) > options_.rest_speed,
             bounces = is_impact && value(restitution) > 0.0;
  const T back = is_impact ? outward * restitution : T(0.0);
  state_.v = state_.v - u * (outward + back);
  lost_energy_ = lost_energy_ + (outward * outward - back * back) * T(0.5);
  taut_ = !bounces && value(taut_pull(time_, state_)) >= 0.0;
}

template <Scalar T, class World>
void BallFlight<T, World>::run_until(const T& until) {
  if (value(until) < time())
    throw Error("ball: asked for " + std::to_string(value(until)) + " s, expected " +
                std::to_string(time()) + " s or later (start() goes back)");
  // Where the string changes its edge, its pull jumps: two phases may end each other without end.
  // After so many ends within a step, none is looked for during kForced.
  constexpr double kForced = 1e-4;  // [s]
  constexpr int kMostEnds = 30;
  int ends = 0;
  double counted_from = time();
  while (time() < value(until)) {
    // Of Jets, time_ may depend on parameters after a switch; the step brings it back to the grid.
    const bool last = value(until) - time() <= options_.step;
    const T h = last ? until - time_ : T(options_.step);
    const ParticleState<T> next = moved(h);
    const double over_next = value(over(time_ + h, next));
    if (!(over_next > 0.0)) {
      state_ = next;
      time_ = last ? until : time_ + h;
      ends = 0;
      continue;
    }
    if (ends == 0 || time() - counted_from > options_.step) {
      ends = 0;
      counted_from = time();
    }
    if (++ends > kMostEnds) {
      const T forced = value(h) < kForced ? h : T(kForced);
      state_ = moved(forced);
      time_ = last && value(h) < kForced ? until : time_ + forced;
      continue;
    }
    const T end = time_to_end(value(h), over_next);
    state_ = moved(end);
    time_ = time_ + end;
    if (taut_) {
      taut_ = false;
    } else if (value(depth(state_)) > 0.0) {
      ++impacts_;
      if constexpr (requires { world_.bounce(state_, spin_); }) world_.bounce(state_, spin_);
    } else {
      become_taut();
    }
  }
}

}  // namespace diffnea
