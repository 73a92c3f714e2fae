#pragma once

#include <algorithm>

namespace diffnea {
namespace detail {

/// K outputs from `first` on, side by side so that no sum waits for itself.
template <int K, class T>
void affine_block(const DenseLayer& l, int first, const T* x, T* y) {
  const double* w = l.weights.data() + first;
  T sum[K];
  for (int k = 0; k < K; ++k) sum[k] = T(l.bias[static_cast<std::size_t>(first + k)]);
  for (int i = 0; i < l.inputs; ++i, w += l.outputs)
    for (int k = 0; k < K; ++k) sum[k] = sum[k] + x[i] * T(w[k]);
  for (int k = 0; k < K; ++k) y[first + k] = sum[k];
}

template <class T>
void affine(const DenseLayer& l, const T* x, T* y) {
  int first = 0;
  for (; first + 8 <= l.outputs; first += 8) affine_block<8>(l, first, x, y);
  for (; first < l.outputs; ++first) affine_block<1>(l, first, x, y);
}

/// One step of an LSTM cell: c ← σ(f) c + σ(i) tanh(g), h ← σ(o) tanh(c), σ(x) = ½ + ½ tanh(½x).
/// @param h, c  (units) each  @param gates  (4 units), i, f, g, o
template <class T>
void lstm_step(int units, const T* gates, T* h, T* c) {
  const T half(0.5);
  const auto sigmoid = [&](const T& x) { return half + half * smooth_sign(T(half * x)); };
  for (int k = 0; k < units; ++k) {
    const T& g = gates[2 * units + k];
    c[k] = sigmoid(gates[units + k]) * c[k] + sigmoid(gates[k]) * smooth_sign(g);
    h[k] = sigmoid(gates[3 * units + k]) * smooth_sign(c[k]);
  }
}

}  // namespace detail

template <class T>
NetworkEvaluator<T>::NetworkEvaluator(const BallNetwork& network)
    : network_(network), input_(kNetworkInputs) {
  int most = kNetworkInputs;
  for (const NetworkMember& m : network.members)
    for (const auto* layers : {&m.cells, &m.layers})
      for (const DenseLayer& l : *layers) most = std::max({most, l.inputs, l.outputs});
  a_.resize(static_cast<std::size_t>(most));
  b_ = a_;
}

/// @return a_, that holds its answer; `hidden` is moved past what is its own
template <class T>
T* NetworkEvaluator<T>::member(const NetworkMember& m, T*& hidden) {
  T *x = a_.data(), *y = b_.data();
  std::copy(input_.begin(), input_.end(), x);
  for (const DenseLayer& cell : m.cells) {
    const int units = cell.outputs / 4;
    std::copy(hidden, hidden + units, x + cell.inputs - units);
    detail::affine(cell, x, y);
    detail::lstm_step(units, y, hidden, hidden + units);
    std::copy(hidden, hidden + units, x);
    hidden += 2 * units;
  }
  for (std::size_t i = 0; i < m.layers.size(); ++i) {
    detail::affine(m.layers[i], x, y);
    if (i + 1 < m.layers.size())
      for (int k = 0; k < m.layers[i].outputs; ++k) y[k] = smooth_sign(y[k]);
    std::swap(x, y);
  }
  return x;
}

template <class T>
Vec3<T> NetworkEvaluator<T>::operator()(const T* input, T* hidden) {
  for (std::size_t k = 0; k < input_.size(); ++k)
    input_[k] = (input[k] - T(network_.input_mean[k])) * T(1.0 / network_.input_scale[k]);
  T sum[kNetworkOutputs] = {T(0.0), T(0.0), T(0.0)};
  for (const NetworkMember& m : network_.members) {
    const T* out = member(m, hidden);
    for (int k = 0; k < kNetworkOutputs; ++k) sum[k] = sum[k] + out[k];
  }
  const T share(1.0 / static_cast<double>(network_.members.size()));
  const auto output = [&](std::size_t k) {
    return T(sum[k] * share * T(network_.output_scale[k]) + T(network_.output_mean[k]));
  };
  return {output(0), output(1), output(2)};
}

template <class T>
void network_input(const LinkMotion<T>& link, const LinkMotion<T>& end, double h, const Vec3<T>& x,
                   const Vec3<T>& v, T* out) {
  const Vec3<T> up{T(0.0), T(0.0), T(1.0)};
  const T rate(1.0 / h);
  for (const Vec3<T>& in_W : {x - link.X_WL.p, v - link.velocity, link.angular_velocity,
                              (end.angular_velocity - link.angular_velocity) * rate,
                              (end.velocity - link.velocity) * rate, up}) {
    const Vec3<T> in_L = transpose_times(link.X_WL.R, in_W);
    *out++ = in_L.x;
    *out++ = in_L.y;
    *out++ = in_L.z;
  }
}

}  // namespace diffnea
