#pragma once
/// The scalar concept. All numerics are templates over two scalars: `P`, the parameters (inertias,
/// fixed transforms), and `S`, the state (positions, velocities, torques). Three instances:
/// `double`, a Ceres `Jet` (derivatives, forward mode), and a SIMD pack (many states at once;
/// core/pack.hpp, internal to the library because its width depends on compiler flags).

#include <cmath>
#include <concepts>
#include <type_traits>

#include <Eigen/Core>
#include <ceres/jet.h>

namespace diffnea {

/// Closed under + − × ÷, constructible from double, with sqrt, sin, cos found by `using std::…` and
/// ADL.
template <class T>
concept Scalar = std::constructible_from<T, double> && requires(T a, T b) {
  { a + b } -> std::convertible_to<T>;
  { a - b } -> std::convertible_to<T>;
  { a* b } -> std::convertible_to<T>;
  { a / b } -> std::convertible_to<T>;
};

/// Scalar of a product: Jet if either factor is one.
template <class A, class B>
using Prod = std::remove_cvref_t<decltype(std::declval<A>() * std::declval<B>())>;

/// Width of the Jets the library is compiled for. Wider derivatives take several sweeps, which is
/// faster than one wide Jet (RNEA of 7 links: two sweeps of Jet⟨7⟩ 5.8 µs, one Jet⟨14⟩ 8.6 µs).
inline constexpr int kJetWidth = 8;
/// A Jet of the width that the library is compiled for.
using JetD = ceres::Jet<double, kJetWidth>;

/// The value without its derivatives.
///@{
inline double value_part(double x) { return x; }
template <int N>
double value_part(const ceres::Jet<double, N>& x) {
  return x.a;
}
///@}

/// Pairs (parameter scalar, state scalar) that are compiled into the library; any other pair
/// compiles in the user's file from the same templates.
#define DIFFNEA_FOR_EACH_SCALAR(X) \
  X(double, double)                \
  X(double, ::diffnea::JetD)       \
  X(::diffnea::JetD, double)       \
  X(::diffnea::JetD, ::diffnea::JetD)

/// A column of any length.
template <class T>
using VecX = Eigen::Matrix<T, Eigen::Dynamic, 1>;
/// A matrix of any size, column-major.
template <class T>
using MatX = Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic>;
/// Row-major matrix: one row per sample of a recording.
template <class T>
using RowMatX = Eigen::Matrix<T, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
/// Read-only vector argument; the scalar is never deduced from it.
template <class T>
using VecIn = Eigen::Ref<const VecX<std::type_identity_t<T>>>;

/// Value part of a scalar: what a decision may look at.
inline double value(double a) { return a; }
/// The plain number, without derivatives.
template <class T, int N>
double value(const ceres::Jet<T, N>& a) {
  return value(a.a);
}

/// tanh(x), which stands for sign(x) in dry friction: packs have one of their own (core/pack.hpp).
template <class T>
T smooth_sign(const T& x) {
  using std::tanh;
  return tanh(x);
}

/// eˣ; packs have one of their own (core/pack.hpp).
template <class T>
T exp_of(const T& x) {
  using std::exp;
  return exp(x);
}

/// `condition ? a : b`, lane by lane for packs. The only way numerics branch on data.
template <class T>
T select(bool condition, const T& a, const T& b) {
  return condition ? a : b;
}

}  // namespace diffnea
