#pragma once
/// A dual number that nests. Where Ceres' Jet ends, its constants must be of the inner scalar,
/// Dual⟨Jet⟩ and Dual⟨Dual⟨T⟩⟩ go on: second derivatives along a path, and derivatives with respect
/// to parameters of what is a derivative itself.

#include <array>

#include <diffnea/core/scalar.hpp>

namespace diffnea {

/// a + Σ v_k ε_k, ε_j ε_k = 0 (Clifford 1873; Griewank and Walther 2008, ch. 3).
template <class T, int N>
struct Dual {
  T a{};                 ///< value
  std::array<T, N> v{};  ///< derivatives, one along each ε_k

  Dual() = default;
  /// A constant: its derivatives are 0.
  Dual(double constant)  // NOLINT(google-explicit-constructor): constants are scalars
      : a(constant) {
    v.fill(T(0.0));
  }
  /// A constant of an inner scalar, however deep.
  template <class U>
    requires(!std::convertible_to<U, double> && !std::same_as<U, Dual> &&
             std::constructible_from<T, U>)
  explicit Dual(const U& constant) : a(constant) {
    v.fill(T(0.0));
  }
  /// The variable with value `x` and derivative 1 along ε_k.
  Dual(const T& x, int k) : a(x) {
    v.fill(T(0.0));
    v[static_cast<std::size_t>(k)] = T(1.0);
  }

  /// f(a) with derivative f'(a), both given.
  Dual chained(const T& f, const T& slope) const {
    Dual out;
    out.a = f;
    for (std::size_t k = 0; k < N; ++k) out.v[k] = slope * v[k];
    return out;
  }

  /// Derivatives by the rules of sum, product and quotient.
  ///@{
  friend Dual operator+(const Dual& x, const Dual& y) {
    Dual out;
    out.a = x.a + y.a;
    for (std::size_t k = 0; k < N; ++k) out.v[k] = x.v[k] + y.v[k];
    return out;
  }
  friend Dual operator-(const Dual& x, const Dual& y) {
    Dual out;
    out.a = x.a - y.a;
    for (std::size_t k = 0; k < N; ++k) out.v[k] = x.v[k] - y.v[k];
    return out;
  }
  friend Dual operator*(const Dual& x, const Dual& y) {
    Dual out;
    out.a = x.a * y.a;
    for (std::size_t k = 0; k < N; ++k) out.v[k] = x.a * y.v[k] + x.v[k] * y.a;
    return out;
  }
  friend Dual operator/(const Dual& x, const Dual& y) {
    const T inverse = T(1.0) / y.a, quotient = x.a * inverse;
    Dual out;
    out.a = quotient;
    for (std::size_t k = 0; k < N; ++k) out.v[k] = (x.v[k] - quotient * y.v[k]) * inverse;
    return out;
  }
  friend Dual operator-(const Dual& x) { return x.chained(-x.a, T(-1.0)); }
  Dual& operator+=(const Dual& y) { return *this = *this + y; }
  Dual& operator-=(const Dual& y) { return *this = *this - y; }
  Dual& operator*=(const Dual& y) { return *this = *this * y; }
  ///@}
};

/// √x; x > 0.
template <class T, int N>
Dual<T, N> sqrt(const Dual<T, N>& x) {
  using std::sqrt;
  const T root = sqrt(x.a);
  return x.chained(root, T(0.5) / root);
}
/// sin x.
template <class T, int N>
Dual<T, N> sin(const Dual<T, N>& x) {
  using std::cos;
  using std::sin;
  return x.chained(sin(x.a), cos(x.a));
}
/// cos x.
template <class T, int N>
Dual<T, N> cos(const Dual<T, N>& x) {
  using std::cos;
  using std::sin;
  return x.chained(cos(x.a), -sin(x.a));
}
/// eˣ.
template <class T, int N>
Dual<T, N> exp(const Dual<T, N>& x) {
  using std::exp;
  const T e = exp(x.a);
  return x.chained(e, e);
}
/// ln x; x > 0.
template <class T, int N>
Dual<T, N> log(const Dual<T, N>& x) {
  using std::log;
  return x.chained(log(x.a), T(1.0) / x.a);
}
/// Angle of the point (x, y) [rad]; not (0, 0).
template <class T, int N>
Dual<T, N> atan2(const Dual<T, N>& y, const Dual<T, N>& x) {
  using std::atan2;
  const T per = T(1.0) / (x.a * x.a + y.a * y.a);
  Dual<T, N> out(atan2(y.a, x.a));
  for (std::size_t k = 0; k < N; ++k) out.v[k] = (x.a * y.v[k] - y.a * x.v[k]) * per;
  return out;
}

/// The plain number, without derivatives.
template <class T, int N>
double value(const Dual<T, N>& x) {
  return value(x.a);
}

}  // namespace diffnea
