#include <algorithm>
#include <cmath>

#include <diffnea/core/text.hpp>
#include <diffnea/recording/joints.hpp>

namespace diffnea {
namespace {

/// RMS of a deviation / its noise that counts as more than noise. Of white noise both are alike:
/// from N rows the ratio is 1 ± 1/√N.
constexpr double kBeyondFollowerNoise = 3.0;
/// Deviation / largest position that a file's digits may leave.
constexpr double kFollowerDigits = 1e-5;

int column_of_joint(const Recording& r, const std::string& joint) {
  const auto at = std::ranges::find(r.joint_names, joint);
  return at == r.joint_names.end() ? -1 : static_cast<int>(at - r.joint_names.begin());
}

/// Compares a follower's positions with those of the relation. The noise is what differences of
/// neighbouring rows show (von Neumann): a deviation that lasts leaves it alone.
void check_relation(const Recording& r, const std::string& leader, int from,
                    const FollowerDescription& f, int of, std::vector<ChannelWarning>& out) {
  double squares = 0.0, steps = 0.0, largest = 0.0, size = 0.0, last = 0.0;
  long rows = 0, pairs = 0;
  for (long k = 0; k < r.rows(); ++k) {
    const double e = r.q(k, of) - (f.ratio * r.q(k, from) + f.offset);
    if (std::isnan(e)) continue;
    if (rows > 0) {
      steps += (e - last) * (e - last);
      ++pairs;
    }
    squares += e * e;
    largest = std::max(largest, std::abs(e));
    size = std::max(size, std::abs(r.q(k, of)));
    last = e;
    ++rows;
  }
  if (pairs == 0) return;
  const double rms = std::sqrt(squares / static_cast<double>(rows)),
               noise = std::max(std::sqrt(0.5 * steps / static_cast<double>(pairs)),
                                kFollowerDigits * size);
  if (!(rms > kBeyondFollowerNoise * noise)) return;
  out.push_back(
      {f.name, "q_" + f.name + " is not " + detail::number_text(f.ratio) + " q_" + leader +
                   (f.offset == 0.0 ? "" : " + " + detail::number_text(f.offset)) +
                   ", as the model has it: RMS of the deviation " + detail::number_text(rms) +
                   ", largest " + detail::number_text(largest) + ", its noise " +
                   detail::number_text(noise) +
                   " (another ratio or offset, a gap or a spring between them?); the "
                   "relation is used, not the column"});
}

void add_follower_torque(Recording& r, int to, const FollowerDescription& f, int from) {
  if (r.tau.size() == 0 || !r.has_tau[static_cast<std::size_t>(from)]) return;
  const VecX<double> share = f.ratio * r.tau.col(from);
  const auto at = static_cast<std::size_t>(to);
  if (r.has_tau[at])
    r.tau.col(to) += share;
  else
    r.tau.col(to) = share;
  r.has_tau[at] = true;
}

}  // namespace

void merge_followers(const std::vector<JointDescription>& joints, Recording& r,
                     std::vector<ChannelWarning>* deviations) {
  std::vector<int> merged;
  for (const JointDescription& j : joints) {
    const int to = column_of_joint(r, j.name);
    for (const FollowerDescription& f : j.followers) {
      const int from = column_of_joint(r, f.name);
      if (from < 0) continue;
      merged.push_back(from);
      std::erase(r.info.passive, f.name);
      if (to < 0) continue;  // match_joints() says it
      if (deviations) check_relation(r, j.name, to, f, from, *deviations);
      add_follower_torque(r, to, f, from);
    }
  }
  if (merged.empty()) return;
  std::vector<int> kept;
  for (int k = 0; k < r.num_joints(); ++k)
    if (std::ranges::find(merged, k) == merged.end()) kept.push_back(k);
  for (const auto member : kJointSeries) {
    RowMatX<double>& m = r.*member;
    if (m.size() > 0) m = RowMatX<double>(m(Eigen::all, kept));
  }
  std::vector<std::string> names;
  std::vector<bool> has_tau;
  for (const int k : kept) {
    names.push_back(r.joint_names[static_cast<std::size_t>(k)]);
    has_tau.push_back(r.has_tau[static_cast<std::size_t>(k)]);
  }
  r.joint_names = names;
  r.has_tau = has_tau;
}

}  // namespace diffnea
