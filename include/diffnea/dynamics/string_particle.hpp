#pragma once
/// A ball on a string: a particle that may be no further than r from a driven anchor S.
///
/// With Δ = x − x_S, h = ‖Δ‖² − r², and a the ball's acceleration without the string (gravity,
/// drag),
///
///   ẍ = a − (T/m) Δ/‖Δ‖,   T/m = max(0, [Δᵀ(a − ẍ_S) + Δ̇ᵀΔ̇ − ½ ḧ*]/‖Δ‖)   where h ≥ 0, else 0
///   ḧ* = min(0, −K_p h − K_d ḣ)
///
/// A string only pulls, becoming taut is an impact, and ball and string do not ask for the ball's
/// mass: with the anchor's motion given, it cancels. This form is smooth in everything, its
/// sharpness to be raised until it does not matter; dynamics/ball_flight.hpp switches exactly.

#include <diffnea/lie/vec3.hpp>

namespace diffnea {

/// Position and velocity in W [m, m/s].
template <Scalar T>
struct ParticleState {
  Vec3<T> x,  ///< position of its centre [m]
      v;      ///< ẋ [m/s]
};

/// The anchor S at an instant, in W [m, m/s, m/s²]. Of a point on a link: frame_motion(), whose
/// acceleration has the α× and ω×(ω×) terms.
template <Scalar T>
struct AnchorMotion {
  Vec3<T> x,  ///< x_S [m]
      v,      ///< ẋ_S [m/s]
      a;      ///< ẍ_S [m/s²]
};

/// What stands in for max(0, ·) and for the switch at h = 0.
enum class Softness {
  kHard,      ///< max and the switch themselves: a ReLU, whose derivative jumps
  kSoftplus,  ///< ln(1 + exp(s·))/s and 1/(1 + exp(−s·)) of the same argument
};

/// How sharply a smoothed string becomes taut, and how it is pulled back to its length.
struct StringSmoothing {
  Softness softness = Softness::kSoftplus;  ///< kHard: `pull` and `switching` are not read
  double pull = 1.0;       ///< sharpness of max(0, T/m) [s²/m]: off by ln 2/s at most
  double switching = 1e3;  ///< sharpness of the switch [1/m], on ‖Δ‖ − r
  double settle = 0.008;   ///< K_p = 1/τ², K_d = 2/τ [s]
};

/// T/m ≥ 0 [m/s²], smooth in everything.
/// @param a  acceleration without the string, in W [m/s²]
/// @param length  r [m]
template <Scalar T>
T string_pull(const ParticleState<T>& ball, const AnchorMotion<T>& anchor, const Vec3<T>& a,
              const T& length, const StringSmoothing& smoothing);

/// ẍ = a − pull Δ/‖Δ‖.
template <Scalar T>
Vec3<T> string_acceleration(const ParticleState<T>& ball, const AnchorMotion<T>& anchor,
                            const Vec3<T>& a, const T& length, const StringSmoothing& smoothing);

}  // namespace diffnea

#include <diffnea/dynamics/detail/string_particle_impl.hpp>
