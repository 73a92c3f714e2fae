#pragma once
/// Explicit Runge–Kutta of order four (Kutta 1901), on any state that adds and scales: a vector, or
/// a matrix that holds the state in its first column and sensitivities in the others.

namespace diffnea {

/// Scratch of one step; keeps its memory between steps.
template <class State>
struct RungeKutta4 {
  State stage,  ///< state at which the last slope was taken
      slope,    ///< ż there
      sum;      ///< z(t + h) as far as it is summed up

  /// Moves z from t to t+h. @param f  f(share, z, dz): slope at t + share·h into dz
  template <class Slope>
  void step(const Slope& f, double h, State& z) {
    f(0.0, z, slope);
    go_on(f, h, z);
  }

  /// The same from the slope at t, which `slope` holds.
  template <class Slope>
  void go_on(const Slope& f, double h, State& z) {
    sum = z + (h / 6.0) * slope;
    stage = z + (0.5 * h) * slope;
    f(0.5, stage, slope);
    sum += (h / 3.0) * slope;
    stage = z + (0.5 * h) * slope;
    f(0.5, stage, slope);
    sum += (h / 3.0) * slope;
    stage = z + h * slope;
    f(1.0, stage, slope);
    z = sum + (h / 6.0) * slope;
  }
};

}  // namespace diffnea
