#pragma once
/// Smooth stand-ins of max(0, x) and of the switch at 0.

#include <diffnea/core/scalar.hpp>

namespace diffnea {

/// ln(1 + eˣ), without overflow.
template <class T>
T softplus(const T& x) {
  using std::exp;
  using std::log;
  return value(x) > 0.0 ? x + log(T(1.0) + exp(-x)) : log(T(1.0) + exp(x));
}
/// 1/(1 + e⁻ˣ), the derivative of softplus, without overflow.
template <class T>
T sigmoid(const T& x) {
  using std::exp;
  if (value(x) > 0.0) return T(1.0) / (T(1.0) + exp(-x));
  const T e = exp(x);
  return e / (T(1.0) + e);
}

}  // namespace diffnea
