#include <algorithm>
#include <cmath>

#include <diffnea/dynamics/kinematics.hpp>
#include <diffnea/identify/hand_motion.hpp>

namespace diffnea {

HandMotion::HandMotion(const Pose<double>& X_WL) : still_(true) {
  const Vec3<double> zero{0, 0, 0};
  const Mat3<double> none{zero, zero, zero};
  rows_.push_back({{X_WL.R, X_WL.p}, {none, zero}, {none, zero}});
}

HandMotion::HandMotion(const Model& model, int link, const Preprocessed& smooth, long first,
                       long rows)
    : begin_(smooth.time[first]), dt_(smooth.dt) {
  const Tree<double> tree = make_tree(model);
  const TreeMap map = map_to_tree(model);
  const auto l = static_cast<std::size_t>(link);
  LinkKinematics<double> kinematics;
  rows_.reserve(static_cast<std::size_t>(rows));
  for (long k = first; k < first + rows; ++k) {
    forward_kinematics<double, double>(tree, smooth.q.row(k).transpose(),
                                       smooth.qd.row(k).transpose(), smooth.qdd.row(k).transpose(),
                                       kinematics);
    const FrameMotion<double> F = frame_motion(kinematics, map.dof[l], map.X_LF[l]);
    const Mat3<double>& R = F.X_WF.R;
    const Mat3<double> w = skew(F.angular_velocity), alpha = skew(F.angular_acceleration);
    rows_.push_back(
        {{R, F.X_WF.p}, {w * R, F.velocity}, {alpha * R + w * (w * R), F.acceleration}});
  }
}

HandMotion::Row HandMotion::row_at(double time) const {
  if (still_) return rows_.front();
  const auto last = static_cast<double>(rows_.size() - 1);
  const double at = std::clamp((time - begin_) / dt_, 0.0, last);  // beyond its ends it stands
  const double low = std::clamp(std::floor(at + 1e-9), 0.0, std::max(0.0, last - 1.0));
  const Row& a = rows_[static_cast<std::size_t>(low)];
  const double s = at - low;
  if (std::abs(s) < 1e-9 || rows_.size() < 2) return a;
  const Row& b = rows_[static_cast<std::size_t>(low) + 1];
  if (std::abs(s - 1.0) < 1e-9) return b;
  // Quintic Hermite basis on [0, 1] for x₀, v₀h, a₀h², x₁, v₁h, a₁h², and its derivatives.
  const double s2 = s * s, s3 = s2 * s, s4 = s3 * s, s5 = s4 * s, h = dt_;
  const std::array<double, 6> x{1 - 10 * s3 + 15 * s4 - 6 * s5,
                                h * (s - 6 * s3 + 8 * s4 - 3 * s5),
                                h * h * 0.5 * (s2 - 3 * s3 + 3 * s4 - s5),
                                10 * s3 - 15 * s4 + 6 * s5,
                                h * (-4 * s3 + 7 * s4 - 3 * s5),
                                h * h * 0.5 * (s3 - 2 * s4 + s5)};
  const std::array<double, 6> v{(-30 * s2 + 60 * s3 - 30 * s4) / h,
                                1 - 18 * s2 + 32 * s3 - 15 * s4,
                                h * 0.5 * (2 * s - 9 * s2 + 12 * s3 - 5 * s4),
                                (30 * s2 - 60 * s3 + 30 * s4) / h,
                                -12 * s2 + 28 * s3 - 15 * s4,
                                h * 0.5 * (3 * s2 - 8 * s3 + 5 * s4)};
  const std::array<double, 6> acc{
      (-60 * s + 180 * s2 - 120 * s3) / (h * h), (-36 * s + 96 * s2 - 60 * s3) / h,
      0.5 * (2 - 18 * s + 36 * s2 - 20 * s3),    (60 * s - 180 * s2 + 120 * s3) / (h * h),
      (-24 * s + 84 * s2 - 60 * s3) / h,         0.5 * (6 * s - 24 * s2 + 20 * s3)};
  const auto mix = [&](const std::array<double, 6>& w) -> Affine {
    const auto sum = [&](const auto& part) {
      return part(a.x) * w[0] + part(a.v) * w[1] + part(a.a) * w[2] + part(b.x) * w[3] +
             part(b.v) * w[4] + part(b.a) * w[5];
    };
    Affine out;
    out.p = sum([](const Affine& m) { return m.p; });
    for (int c = 0; c < 3; ++c) out.R.col[c] = sum([c](const Affine& m) { return m.R.col[c]; });
    return out;
  };
  return {mix(x), mix(v), mix(acc)};
}

}  // namespace diffnea
