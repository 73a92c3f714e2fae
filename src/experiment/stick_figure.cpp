#include <algorithm>
#include <cmath>

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/kinematics.hpp>
#include <diffnea/experiment/stick_figure.hpp>

namespace diffnea {
namespace {

/// A point fixed to a link of the tree; −1: to the world.
struct Fixed {
  int link;
  Pose<double> X_LF;
};

Fixed fixed_point(const TreeMap& map, int link, const Pose<double>& X_LF) {
  return link < 0 ? Fixed{-1, X_LF} : Fixed{map.dof[link], map.X_LF[link] * X_LF};
}

/// Origins of the links that carry the cup, from the foot up, then the cup's.
std::vector<Fixed> arm_points(const Model& model, const TreeMap& map) {
  const auto cup = std::ranges::find(model.frames, "cup", &ModelFrame::name);
  if (!model.cup || cup == model.frames.end())
    throw ModelError(model.source + ": has no cup, nothing to draw");
  std::vector<Fixed> out{fixed_point(map, cup->link, cup->X_LF)};
  for (int link = cup->link; link >= 0; link = model.links[link].parent)
    out.push_back(fixed_point(map, link, Pose<double>::identity()));
  std::ranges::reverse(out);
  return out;
}

}  // namespace

VecX<double> channel_of(const RolloutTrace& trace, const std::string& name) {
  const auto it = std::ranges::find(trace.channels, name);
  if (it == trace.channels.end()) throw Error("a rollout: it shows no channel " + name);
  return trace.values.col(it - trace.channels.begin());
}

RowMatX<double> points_of(const RolloutTrace& trace, const std::string& name) {
  RowMatX<double> out(trace.time.size(), 3);
  for (int k = 0; k < 3; ++k) out.col(k) = channel_of(trace, name + "_" + "xyz"[k]);
  return out;
}

SideView side_view(const std::vector<RolloutTrace>& traces) {
  double xx = 0.0, xy = 0.0, yy = 0.0;
  for (const RolloutTrace& trace : traces) {
    if (trace.time.size() == 0) continue;
    RowMatX<double> p = points_of(trace, "ball").leftCols(2);
    p.rowwise() -= p.colwise().mean().eval();
    xx += p.col(0).squaredNorm();
    yy += p.col(1).squaredNorm();
    xy += p.col(0).dot(p.col(1));
  }
  if (!(xx + yy > 0.0)) return {};
  // The first principal axis, φ = ½ atan2(2 Σxy, Σxx − Σyy), −90° … 90°
  double angle = 0.5 * std::atan2(2.0 * xy, xx - yy);
  constexpr double kRight = M_PI / 2, kNear = M_PI / 18;
  const double nearest = kRight * std::round(angle / kRight);
  if (std::abs(angle - nearest) < kNear) angle = std::abs(nearest);
  return {std::cos(angle), std::sin(angle)};
}

StickFigure stick_figure(const Model& model, const RolloutTrace& trace, const SideView& view) {
  const Tree<double> tree = make_tree(model);
  const TreeMap map = map_to_tree(model);
  const std::vector<Fixed> arm = arm_points(model, map);
  StickFigure out;
  out.time = trace.time;
  for (std::size_t i = 0; i < arm.size(); ++i) out.names.push_back("arm_" + std::to_string(i));
  for (const char* name : {"knot", "rim_left", "floor_left", "floor_right", "rim_right", "ball"})
    out.names.emplace_back(name);
  const long rows = trace.time.size(), points = static_cast<long>(out.names.size());
  out.across.resize(rows, points);
  out.up.resize(rows, points);
  if (rows == 0) return out;

  const std::vector<std::string> joints = joint_names(model);
  RowMatX<double> q(rows, static_cast<long>(joints.size()));
  for (std::size_t j = 0; j < joints.size(); ++j)
    q.col(static_cast<long>(j)) = channel_of(trace, "q_" + joints[j]);
  const RowMatX<double> ball = points_of(trace, "ball"), cup = points_of(trace, "cup"),
                        axis = points_of(trace, "axis");
  Pose<double> X_LS = Pose<double>::identity();
  int string_link = -1;
  if (model.ball && model.ball->string) {
    X_LS.p = model.ball->string->p_LS;
    string_link = model.ball->string->link;
  }
  const Fixed knot = fixed_point(map, string_link, X_LS);

  LinkKinematics<double> links;
  for (long k = 0; k < rows; ++k) {
    long column = 0;
    const auto put = [&](double across, double up) {
      out.across(k, column) = across;
      out.up(k, column++) = up;
    };
    const auto put_point = [&](const Fixed& f) {
      const Vec3<double> p = f.link < 0 ? f.X_LF.p : frame_pose(links, f.link, f.X_LF).p;
      put(view.x * p.x + view.y * p.y, p.z);
    };
    const auto across = [&](const RowMatX<double>& p) {
      return view.x * p(k, 0) + view.y * p(k, 1);
    };
    const VecX<double> q_k = q.row(k).transpose();
    forward_kinematics<double, double>(tree, q_k, links);
    for (const Fixed& f : arm) put_point(f);
    put_point(knot);
    // The cup's outline: its axis a as the plane shows it, and s across it.
    const double a[] = {across(axis), axis(k, 2)}, length = std::hypot(a[0], a[1]);
    const double s[] = {length > 0.0 ? a[1] / length : 1.0, length > 0.0 ? -a[0] / length : 0.0};
    const double r = model.cup->inner_radius, rim = model.cup->rim, floor = model.cup->floor;
    for (const auto& [height, side] : {std::pair{rim, -r}, {floor, -r}, {floor, r}, {rim, r}})
      put(across(cup) + height * a[0] + side * s[0], cup(k, 2) + height * a[1] + side * s[1]);
    put(across(ball), ball(k, 2));
  }
  return out;
}

}  // namespace diffnea
