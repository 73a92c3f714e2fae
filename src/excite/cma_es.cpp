#include "excite/cma_es.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "core/decompositions.hpp"

namespace diffnea {

CmaResult minimise_by_samples(const std::function<double(const VecX<double>&)>& function,
                              const VecX<double>& start, const CmaOptions& options, Rng& rng,
                              const std::function<bool(int, double)>& go_on) {
  const long d = start.size();
  const double n = static_cast<double>(d);
  const int samples = 4 + static_cast<int>(3.0 * std::log(n)), parents = samples / 2;
  VecX<double> weight(parents);
  for (int i = 0; i < parents; ++i) weight[i] = std::log(0.5 * (samples + 1)) - std::log(i + 1.0);
  weight /= weight.sum();
  const double mu = 1.0 / weight.squaredNorm();
  // Table 1 of the tutorial.
  const double c_sigma = (mu + 2.0) / (n + mu + 5.0);
  const double damping =
      1.0 + 2.0 * std::max(0.0, std::sqrt((mu - 1.0) / (n + 1.0)) - 1.0) + c_sigma;
  const double c_c = (4.0 + mu / n) / (n + 4.0 + 2.0 * mu / n);
  const double c_1 = 2.0 / ((n + 1.3) * (n + 1.3) + mu);
  const double c_mu =
      std::min(1.0 - c_1, 2.0 * (mu - 2.0 + 1.0 / mu) / ((n + 2.0) * (n + 2.0) + mu));
  const double expected = std::sqrt(n) * (1.0 - 1.0 / (4.0 * n) + 1.0 / (21.0 * n * n));

  CmaResult best{start, function(start)};
  VecX<double> mean = start, p_sigma = VecX<double>::Zero(d), p_c = p_sigma;
  MatX<double> C = MatX<double>::Identity(d, d), B = C;
  VecX<double> D = VecX<double>::Ones(d);
  double sigma = options.step;
  MatX<double> y(d, samples);
  std::vector<double> value(static_cast<std::size_t>(samples));
  std::vector<int> order(value.size());
  // The axes are computed anew when the updates have summed up to a tenth.
  const int keep_axes = std::max(1, static_cast<int>(0.1 / ((c_1 + c_mu) * n)));
  for (int g = 0; g < options.generations && sigma * D.maxCoeff() > options.least_step; ++g) {
    for (int i = 0; i < samples; ++i) {
      VecX<double> z(d);
      for (double& v : z) v = rng.normal();
      y.col(i) = B * D.cwiseProduct(z);
      const VecX<double> x = mean + sigma * y.col(i);
      value[static_cast<std::size_t>(i)] = function(x);
      if (value[static_cast<std::size_t>(i)] < best.value)
        best.x = x, best.value = value[static_cast<std::size_t>(i)];
    }
    std::iota(order.begin(), order.end(), 0);
    std::ranges::stable_sort(order, {}, [&](int i) { return value[static_cast<std::size_t>(i)]; });
    VecX<double> step = VecX<double>::Zero(d);
    for (int i = 0; i < parents; ++i) step += weight[i] * y.col(order[static_cast<std::size_t>(i)]);
    mean += sigma * step;
    p_sigma = (1.0 - c_sigma) * p_sigma + std::sqrt(c_sigma * (2.0 - c_sigma) * mu) *
                                              (B * (B.transpose() * step).cwiseQuotient(D));
    const double length = p_sigma.norm();
    const bool calm = length / std::sqrt(1.0 - std::pow(1.0 - c_sigma, 2.0 * (g + 1))) <
                      (1.4 + 2.0 / (n + 1.0)) * expected;
    p_c = (1.0 - c_c) * p_c + (calm ? std::sqrt(c_c * (2.0 - c_c) * mu) : 0.0) * step;
    C *= 1.0 - c_1 - c_mu + (calm ? 0.0 : c_1 * c_c * (2.0 - c_c));
    C += c_1 * p_c * p_c.transpose();
    for (int i = 0; i < parents; ++i) {
      const VecX<double> s = y.col(order[static_cast<std::size_t>(i)]);
      C += c_mu * weight[i] * s * s.transpose();
    }
    sigma *= std::exp(std::min(1.0, c_sigma / damping * (length / expected - 1.0)));
    if ((g + 1) % keep_axes == 0) {
      const Eigen::SelfAdjointEigenSolver<MatX<double>> eigen(C);
      B = eigen.eigenvectors();
      D = eigen.eigenvalues().cwiseMax(1e-20).cwiseSqrt();
    }
    best.generations = g + 1;
    if (go_on && !go_on(g + 1, best.value)) {
      best.interrupted = true;
      break;
    }
  }
  return best;
}

}  // namespace diffnea
