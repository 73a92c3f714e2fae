#pragma once
/// A ball in time: free flight, a pendulum of fixed length while its string is taut, and the
/// switches between them; it may also bounce off a plane. The string becomes taut where h = ‖x −
/// x_S‖² − r² reaches 0, an impact in which the velocity along the string is lost, or reversed and
/// multiplied by the restitution; it becomes slack where its pull reaches 0. With a = the
/// acceleration without the string,
///
///   taut:  ẍ = a − Δ (Δᵀ(a − ẍ_S) + Δ̇ᵀΔ̇)/‖Δ‖²
///
/// Runge–Kutta 4; switches are bracketed to rounding; a taut ball goes back to the sphere after
/// every step. Of Jets, the time of a switch is one too (the implicit function theorem), so that
/// derivatives hold across switches (Hiskens and Pai 2000), except where a string is only grazed.

#include <algorithm>
#include <concepts>

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/string_route.hpp>

namespace diffnea {

/// What forces on the ball may depend on.
template <Scalar T>
struct BallSample {
  T time{};                ///< [s]
  ParticleState<T> ball;   ///< its centre, in W
  bool taut = false;       ///< whether the string holds it on the sphere
  AnchorMotion<T> anchor;  ///< where there is a string: from where on it is free
  T length{};              ///< from there [m]
  Vec3<T> u;               ///< from there to the ball, of length 1
  Vec3<T> spin;            ///< ω of the ball, in W [rad/s]; impacts on a plane change it
};

/// Steps and tolerances of a simulated flight.
struct FlightOptions {
  double step = 2e-3;        ///< [s], at most
  double restitution = 0.0;  ///< of the impact when the string becomes taut
  double rest_speed = 1e-3;  ///< below it an impact leaves the string taut [m/s]
};

/// World:
///   bool has_string() const;  T length() const;              // r [m]
///   AnchorMotion<T> anchor(const T& time) const;             // of S
/// and where something may bar the string, in place of anchor(); length() is that of all of it
///   FreeString<T> string(const T& time, const Vec3<T>& x) const;  // of a ball at x
/// or where it throws the ball back
///   T rebound() const;                                       // in place of options' restitution
///   Vec3<T> acceleration(const BallSample<T>& x) const;      // without the string, in W [m/s²]
/// and where there is a plane to bounce off, which a taut ball is not asked about:
///   T clearance(const ParticleState<T>& s) const;            // of the ball over it [m]
///   void bounce(ParticleState<T>& s, Vec3<T>& spin) const;   // it leaves upward after this
template <Scalar T, class World>
class BallFlight {
 public:
  /// @throws ModelError if there is a string whose length is not positive
  explicit BallFlight(const World& world, const FlightOptions& options = {});

  /// Starts at a time and state. A ball further than r is put at r, and loses what velocity it has
  /// away from the anchor; `taut` says so of one that is nearer.
  void start(const T& time, const ParticleState<T>& state, bool taut = false,
             const Vec3<T>& spin = {});
  /// Begins at a state. @param spin  [rad/s], in the world
  void start(double time, const ParticleState<T>& state, bool taut = false,
             const Vec3<T>& spin = {})
    requires(!std::same_as<T, double>)
  {
    start(T(time), state, taut, spin);
  }
  /// Goes on until `time` [s]. @throws Error if it lies in the past
  void run_until(const T& time);
  /// Moves on to `time` [s], not before the present one.
  void run_until(double time)
    requires(!std::same_as<T, double>)
  {
    run_until(T(time));
  }

  /// [s]
  double time() const { return value(time_); }
  /// Position [m] and velocity [m/s] in the world.
  const ParticleState<T>& state() const { return state_; }
  /// Whether the string pulls.
  bool taut() const { return taut_; }
  T pull() const;  ///< T/m now [m/s²]; 0 if slack
  /// The present state, as forces on the ball see it.
  BallSample<T> sample() const { return sample(time_, state_, taut_); }
  /// Impacts since the start: of the string becoming taut, and on the plane.
  long impacts() const { return impacts_; }
  T lost_energy() const { return lost_energy_; }  ///< to the string's impacts, per mass [m²/s²]

 private:
  FreeString<T> string_at(const T& time, const Vec3<T>& x) const;
  BallSample<T> sample(const T& time, const ParticleState<T>& s, bool taut) const;
  ParticleState<T> moved(const T& h) const;
  T taut_pull(const T& time, const ParticleState<T>& s) const;
  T excess(const T& time, const ParticleState<T>& s) const;  ///< h [m²]
  void settle(ParticleState<T>& s, const T& time) const;
  void become_taut();
  /// What tells that the present phase ends: above 0, it has.
  T over(const T& time, const ParticleState<T>& s) const;
  /// Depth in the plane [m]; below 0 where there is none, or the string is taut.
  T depth(const ParticleState<T>& s) const;
  T time_to_end(double h, double over_after) const;

  const World& world_;
  FlightOptions options_;
  T time_{};
  ParticleState<T> state_{};
  Vec3<T> spin_{};
  bool taut_ = false;
  long impacts_ = 0;
  T lost_energy_{};
};

}  // namespace diffnea

#include <diffnea/dynamics/detail/ball_flight_impl.hpp>
