#include <algorithm>
#include <cmath>
#include <limits>

#include <diffnea/core/error.hpp>
#include <diffnea/policy/ball_in_cup.hpp>

namespace diffnea {
namespace {

void require_task(bool ok, const char* what) {
  if (!ok) throw Error(std::string("BallInCupTask: ") + what);
}

/// For so long a ball that nothing holds has to be in the cup at the end, as in a world where that
/// is judged (sim/ball_in_cup.hpp) [s].
constexpr double kStays = 0.5;

constexpr double code(BallPhase phase) { return static_cast<double>(phase); }

}  // namespace

BallInCupTask::BallInCupTask(const BallInCupOptions& options) : options_(options) {
  require_task(options.epsilon > 0.0 && options.string > 0.0,
               "epsilon and string must be positive");
  require_task(options.lambda_q >= 0.0 && options.lambda_qd >= 0.0,
               "lambda_q and lambda_qd must not be negative");
}

void BallInCupTask::begin(const Simulator& simulator, int count) {
  q_.clear();
  qd_.clear();
  for (const std::string& joint : simulator.joints()) {
    q_.push_back(find_channel(simulator, "q_" + joint));
    qd_.push_back(find_channel(simulator, "qd_" + joint));
  }
  for (int k = 0; k < 3; ++k) {
    const std::string suffix = std::string("_") + "xyz"[k];
    ball_[k] = find_channel(simulator, "ball" + suffix);
    cup_[k] = find_channel(simulator, "cup" + suffix);
    axis_[k] = find_channel(simulator, "axis" + suffix);
  }
  phase_row_ = find_channel(simulator, "phase");

  q0_.resize(0, count);  // until the first look
  for (VecX<double>* x : {&looks_, &penalty_, &psi_, &phase_, &live_, &now_}) x->setZero(count);
  psi_most_.setConstant(count, -std::numeric_limits<double>::infinity());
  outside_.setZero(count);
  time_ = 0.0;
}

void BallInCupTask::look(double time, const Lanes& observation, std::vector<char>& ended) {
  const long n = looks_.size();
  if (q0_.rows() == 0) q0_ = observation(q_, Eigen::seqN(0, n));
  const auto row = [&](int channel) { return observation.data() + channel * observation.cols(); };
  double* const live = live_.data();
  double* const now = now_.data();
  for (long i = 0; i < n; ++i) live[i] = ended[static_cast<std::size_t>(i)] ? 0.0 : 1.0;

  now_.setZero();
  for (std::size_t j = 0; j < q_.size(); ++j) {
    const double *q = row(q_[j]), *qd = row(qd_[j]), *q0 = q0_.data() + static_cast<long>(j) * n;
    for (long i = 0; i < n; ++i) {
      const double moved = q[i] - q0[i];
      now[i] += options_.lambda_q * moved * moved + options_.lambda_qd * qd[i] * qd[i];
    }
  }

  const double *bx = row(ball_[0]), *by = row(ball_[1]), *bz = row(ball_[2]);
  const double *cx = row(cup_[0]), *cy = row(cup_[1]), *cz = row(cup_[2]);
  const double *mx = row(axis_[0]), *my = row(axis_[1]), *mz = row(axis_[2]);
  const double* phase = row(phase_row_);
  double *looks = looks_.data(), *penalty = penalty_.data(), *psi = psi_.data(),
         *most = psi_most_.data(), *last_phase = phase_.data();
  const double per_length = 1.0 / options_.string, lambda_slack = options_.lambda_slack;
  for (long i = 0; i < n; ++i) {
    const double x = bx[i] - cx[i], y = by[i] - cy[i], z = bz[i] - cz[i];
    const double squared = x * x + y * y + z * z;
    const double p = (x * mx[i] + y * my[i] + z * mz[i]) / (squared + options_.epsilon);
    const bool lives = live[i] != 0.0;
    const double slack = std::max(0.0, 1.0 - std::sqrt(squared) * per_length);
    looks[i] += live[i];
    // 0 ψ: a ball that is NaN for once shows in the reward; the maximum would forget it.
    const bool outside =
        phase[i] == code(BallPhase::kFree) || phase[i] == code(BallPhase::kImagined);
    const double loose = outside ? lambda_slack * slack * slack : 0.0;
    penalty[i] += lives ? now[i] + loose + 0.0 * p : 0.0;
    psi[i] = lives ? p : psi[i];
    most[i] = lives && p > most[i] ? p : most[i];
    last_phase[i] = lives ? phase[i] : last_phase[i];
  }
  time_ = time;
  for (long i = 0; i < n; ++i)
    if (phase_[i] != code(BallPhase::kInside)) outside_[i] = time;
  for (long i = 0; i < n; ++i)
    if (phase_[i] == code(BallPhase::kTouched) || phase_[i] == code(BallPhase::kUpsideDown))
      ended[static_cast<std::size_t>(i)] = 1;
}

VecX<double> BallInCupTask::rewards() const {
  const double r = options_.string, hanging = -r / (r * r + options_.epsilon);
  VecX<double> out(looks_.size());
  for (long i = 0; i < out.size(); ++i) {
    const bool as_it_is = phase_[i] == code(BallPhase::kCaptured) ||
                          phase_[i] == code(BallPhase::kImagined) ||
                          phase_[i] == code(BallPhase::kInside);
    const double at_end = as_it_is ? psi_[i] : std::min(psi_[i], hanging);
    out[i] = std::exp(0.5 * psi_most_[i] + 0.5 * at_end) - penalty_[i] / looks_[i];
  }
  return out;
}

std::vector<char> BallInCupTask::solved() const {
  std::vector<char> out(static_cast<std::size_t>(phase_.size()));
  for (long i = 0; i < phase_.size(); ++i)
    out[static_cast<std::size_t>(i)] =
        phase_[i] == code(BallPhase::kCaptured) ||
        (phase_[i] == code(BallPhase::kInside) && time_ - outside_[i] >= kStays);
  return out;
}

std::unique_ptr<Task> BallInCupTask::clone() const {
  return std::make_unique<BallInCupTask>(options_);
}

}  // namespace diffnea
