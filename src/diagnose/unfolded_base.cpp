#include "diagnose/unfolded_base.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include <Eigen/Geometry>

#include <diffnea/core/error.hpp>
#include <diffnea/dynamics/kinematics.hpp>
#include <diffnea/effects/catalogue.hpp>
#include <diffnea/model/free_base.hpp>

#include "core/constants.hpp"
#include "core/decompositions.hpp"
#include "core/number_text.hpp"

namespace diffnea {
namespace {

using Vec3d = Eigen::Vector3d;
using Mat3d = Eigen::Matrix3d;

/// Cosine of the middle hinge, at least: the outer hinges show an orientation's noise divided by
/// it.
constexpr double kLeastCosine = 0.2;
/// The same, from which yaw, pitch and roll serve: twice the noise.
constexpr double kUsualCosine = 0.5;

/// Deviation of the centre of mass from free fall, over gravity, from which something holds or
/// touches the robot: masses that are wrong by a half move it less, and a foot on the ground more.
constexpr double kContact = 0.3;

/// Where effects on the base itself act, in the robot that floats.
constexpr const char* kBasePlace = "base";

Mat3d rotation(const Eigen::Ref<const RowMatX<double>>& base) {
  return Eigen::Quaterniond(base(0, 6), base(0, 3), base(0, 4), base(0, 5))
      .normalized()
      .toRotationMatrix();
}

Mat3<double> matrix(const Mat3d& R) {
  Mat3<double> out;
  for (int c = 0; c < 3; ++c) out.col[c] = {R(0, c), R(1, c), R(2, c)};
  return out;
}

/// Lines through the origin: axes, diagonals of faces, diagonals of a cube.
std::vector<Vec3d> lines() {
  std::vector<Vec3d> out{Vec3d::UnitZ(), Vec3d::UnitX(), Vec3d::UnitY()};
  for (const double s : {1.0, -1.0})
    for (const Vec3d& v :
         {Vec3d(1, s, 0), Vec3d(1, 0, s), Vec3d(0, 1, s), Vec3d(1, 1, s), Vec3d(1, -1, s)})
      out.push_back(v.normalized());
  return out;
}

/// Columns of the base's joints before those of the others.
RowMatX<double> behind(const RowMatX<double>& lead, const RowMatX<double>& m) {
  RowMatX<double> out(lead.rows(), lead.cols() + m.cols());
  out << lead, m;
  return out;
}

/// The name, with as many underscores behind it as it takes to be no other's.
std::string unused(std::string name, const Model& model) {
  while (std::ranges::any_of(model.links,
                             [&](const ModelLink& l) { return l.name == name || l.joint == name; }))
    name += "_";
  return name;
}

/// How the centre of mass of one run falls: a parabola through it, by least squares.
class Fall {
 public:
  Fall(const Model& model, const Recording& first)
      : tree_(make_tree(model)), source_(first.source), begin_(first.time[0]) {}

  /// @param r  a block of the run, whose wrench is zero
  void add(const Recording& r) {
    LinkKinematics<double> links;
    VecX<double> q(tree_.num_positions());
    for (long k = 0; k < r.rows(); ++k) {
      q << r.base.row(k).transpose(), r.q.row(k).transpose();
      if (!q.allFinite()) continue;
      q.segment<4>(3).normalize();
      forward_kinematics<double, double>(tree_, q, links);
      double mass = 0.0;
      Vec3d moment = Vec3d::Zero();
      for (std::size_t i = 0; i < tree_.links.size(); ++i) {
        const SpatialInertia<double>& body = tree_.links[i].inertia;
        const Pose<double>& X = links.links[i].X_WL;
        mass += body.m;
        moment += to_eigen(X.p * body.m + X.R * body.h);
      }
      const double t = r.time[k] - begin_;
      const Vec3d powers(1.0, t, 0.5 * t * t);
      normal_ += powers * powers.transpose();
      moments_ += powers * (moment / mass).transpose();
      ++rows_;
    }
  }
  /// @throws DataError if the robot does not fall
  void require() const {
    if (rows_ < kLeastRows) return;
    const Vec3d acceleration = normal_.ldlt().solve(moments_).row(2).transpose(),
                gravity = to_eigen(tree_.gravity);
    if ((acceleration - gravity).norm() < kContact * gravity.norm()) return;
    throw DataError(
        source_ + ": diagnose: the robot's centre of mass accelerates by " +
        detail::number_text(acceleration.norm(), 3) + " m/s² and not as in free fall, by " +
        detail::number_text(gravity.norm(), 3) +
        " m/s²: something holds or touches it. Forces of contacts are not modelled; give flights "
        "alone, each with its number in `run`, record the wrench (base_tx … base_fz), or read a "
        "base that stood still as fixed (--fix-base)");
  }

 private:
  static constexpr long kLeastRows = 20;  ///< rows of a parabola that are no noise

  Tree<double> tree_;
  std::string source_;
  double begin_;
  Mat3d normal_ = Mat3d::Zero(), moments_ = Mat3d::Zero();
  long rows_ = 0;
};

/// @throws DataError if some run is no flight; one whose wrench is known may be anything
void require_flights(const Model& model, const RecordingSource& source) {
  if (dot(model.gravity, model.gravity) == 0.0) return;
  std::optional<Fall> fall;
  int run = -1;
  source.for_each([&](const Recording& r) {
    if (r.run != run && fall) {
      fall->require();
      fall.reset();
    }
    run = r.run;
    if (r.base_wrench.size() > 0 || r.rows() == 0) return true;
    if (!fall) fall.emplace(model, r);
    fall->add(r);
    return true;
  });
  if (fall) fall->require();
}

}  // namespace

/// Angles of R = R_0 R_z(yaw) R_y(pitch) R_x(roll) R_1.
struct UnfoldedBase::Hinges {
  Mat3d outer = Mat3d::Identity(), inner = Mat3d::Identity();  ///< R_0, R_1

  /// The nearest to `before`, of one pose after another.
  Vec3d angles(const Mat3d& R, const Vec3d& before) const {
    const Mat3d M = outer.transpose() * R * inner.transpose();
    Vec3d out(std::atan2(M(1, 0), M(0, 0)), std::asin(std::clamp(-M(2, 0), -1.0, 1.0)),
              std::atan2(M(2, 1), M(2, 2)));
    for (const int k : {0, 2}) out[k] += 2.0 * kPi * std::round((before[k] - out[k]) / (2.0 * kPi));
    return out;
  }
  /// Axes of the hinges in the world, a column each.
  Mat3d axes(const Mat3d& R, const Vec3d& angles) const {
    Mat3d out;
    out << outer.col(2), outer * Eigen::AngleAxisd(angles[0], Vec3d::UnitZ()) * Vec3d::UnitY(),
        R * inner.row(0).transpose();
    return out;
  }
};

/// Recordings of another source, block by block.
class UnfoldedBase::Source : public RecordingSource {
 public:
  Source(const RecordingSource& of, const UnfoldedBase& base) : of_(of), base_(base) {}

  void for_each(const std::function<bool(const Recording&)>& use) const override {
    int run = -1;
    Vec3d before = Vec3d::Zero();
    of_.for_each([&](const Recording& block) {
      if (block.run != run) before.setZero();
      run = block.run;
      return use(unfolded(block, before));
    });
  }
  std::vector<Recording> sample() const override {
    std::vector<Recording> out;
    for (const Recording& r : of_.sample()) {
      Vec3d before = Vec3d::Zero();
      out.push_back(unfolded(r, before));
    }
    return out;
  }
  std::vector<int> runs() const override { return of_.runs(); }
  std::vector<RunDescription> describe_runs() const override { return of_.describe_runs(); }
  bool holds_payload() const override { return of_.holds_payload(); }
  const ReadReport& report() const override { return of_.report(); }
  const std::vector<ChannelWarning>& warnings() const override { return of_.warnings(); }

 private:
  /// @param before  angles of the row before, NaN excepted; overwritten by those of the last
  Recording unfolded(const Recording& r, Vec3d& before) const {
    const long rows = r.rows();
    const bool pushed = r.base_wrench.size() > 0,
               moves = r.base_twist.size() > 0 && (r.qd.size() > 0 || r.num_joints() == 0);
    RowMatX<double> q = RowMatX<double>::Constant(rows, kBaseJoints, kNaN), qd = q,
                    tau = RowMatX<double>::Zero(rows, kBaseJoints);
    for (long k = 0; k < rows; ++k) {
      if (!r.base.row(k).allFinite()) {
        if (pushed) tau.row(k).setConstant(kNaN);
        continue;
      }
      const Mat3d R = rotation(r.base.row(k));
      before = base_.hinges_->angles(R, before);
      q.row(k) << r.base.row(k).head<3>(), before.transpose();
      const Mat3d axes = base_.hinges_->axes(R, before);
      if (moves)
        qd.row(k) << (R * r.base_twist.row(k).tail<3>().transpose()).transpose(),
            axes.fullPivLu().solve(R * r.base_twist.row(k).head<3>().transpose()).transpose();
      if (pushed)
        tau.row(k) << (R * r.base_wrench.row(k).tail<3>().transpose()).transpose(),
            (axes.transpose() * R * r.base_wrench.row(k).head<3>().transpose()).transpose();
    }
    Recording out = r;
    for (auto member : {&Recording::base, &Recording::base_twist, &Recording::base_wrench,
                        &Recording::qdd, &Recording::qcmd, &Recording::qdcmd, &Recording::taucmd})
      (out.*member).resize(0, 0);
    out.q = behind(q, r.q);
    out.qd = moves ? behind(qd, r.qd) : RowMatX<double>();
    out.tau = behind(tau, r.tau);
    out.joint_names.insert(out.joint_names.begin(), base_.names_.begin(), base_.names_.end());
    out.has_tau.insert(out.has_tau.begin(), kBaseJoints, pushed);
    if (!pushed)
      out.info.passive.insert(out.info.passive.end(), base_.names_.begin(), base_.names_.end());
    return out;
  }

  const RecordingSource& of_;
  const UnfoldedBase& base_;
};

UnfoldedBase::UnfoldedBase(const Model& model, const RecordingSource& train,
                           const RecordingSource* test)
    : folded_(model),
      logged_train_(train),
      logged_test_(test),
      unfolded_(model),
      hinges_(std::make_unique<Hinges>()) {
  require_no_constraints("diagnose of a robot that floats", model);
  for (const RecordingSource* of : {&train, test})
    if (of) require_flights(model, *of);
  const std::vector<Vec3d> of_world = lines(), of_base = lines();
  MatX<double> largest = MatX<double>::Zero(std::ssize(of_world), std::ssize(of_base));
  Eigen::Matrix3Xd w(3, std::ssize(of_world)), u(3, std::ssize(of_base));
  for (long k = 0; k < w.cols(); ++k) w.col(k) = u.col(k) = of_world[k];
  bool pushed = true;
  std::string source;
  for (const RecordingSource* of : {&train, test}) {
    if (of == nullptr) continue;
    of->for_each([&](const Recording& r) {
      if (source.empty()) source = r.source;
      pushed = pushed && r.base_wrench.size() > 0;
      for (long k = 0; k < r.rows(); ++k)
        if (r.base.row(k).allFinite())
          largest = largest.cwiseMax((w.transpose() * rotation(r.base.row(k)) * u).cwiseAbs());
      return true;
    });
  }
  long i = 0, j = 0;
  const double sine = std::min(largest.minCoeff(&i, &j), 1.0);
  // Yaw, pitch and roll where they serve: the first lines are z and, of the base, x.
  if (std::pow(largest(0, 1), 2) < 1.0 - kUsualCosine * kUsualCosine) i = 0, j = 1;
  if (const double cosine = std::sqrt(1.0 - sine * sine); cosine < kLeastCosine)
    throw DataError(source +
                    ": diagnose: the base turns through all directions, so that no three hinges "
                    "describe it (cosine " +
                    detail::number_text(cosine, 2) + " of the middle one, expected " +
                    detail::number_text(kLeastCosine, 2) +
                    " or more); give fewer or shorter flights at once");
  if (i != 0 || j != 1) {
    const auto text = [](const Vec3d& v) {
      return "(" + detail::number_text(v[0], 2) + " " + detail::number_text(v[1], 2) + " " +
             detail::number_text(v[2], 2) + ")";
    };
    note_ =
        "base_yaw and base_roll are not about z of the world and x of the base, which come too "
        "near "
        "each other, but about " +
        text(w.col(i)) + " of the world and " + text(u.col(j)) + " of the base";
  }
  hinges_->outer = Eigen::Quaterniond::FromTwoVectors(Vec3d::UnitZ(), w.col(i)).toRotationMatrix();
  hinges_->inner = Eigen::Quaterniond::FromTwoVectors(u.col(j), Vec3d::UnitX()).toRotationMatrix();

  constexpr std::array kNames{"base_x", "base_y", "base_z", "base_yaw", "base_pitch", "base_roll"};
  for (const char* name : kNames) names_.push_back(unused(name, model));
  std::vector<ModelLink> links;
  for (int k = 0; k < kBaseJoints; ++k) {
    ModelLink link;
    if (k == kBaseJoints - 1) link = model.links[0];
    link.joint = names_[k];
    if (k < kBaseJoints - 1) link.name = link.joint;
    link.parent = k - 1;
    link.type = k < 3 ? ModelJoint::kPrismatic : ModelJoint::kRevolute;
    link.X_PJ = Pose<double>::identity();
    link.passive = !pushed;
    links.push_back(link);
  }
  links[0].axis = {1, 0, 0};
  links[1].axis = links[4].axis = {0, 1, 0};
  links[2].axis = links[3].axis = {0, 0, 1};
  links[3].X_PJ.R = matrix(hinges_->outer);
  links[5].X_PJ.R = matrix(hinges_->inner);
  links[5].axis = {u(0, j), u(1, j), u(2, j)};
  for (std::size_t k = 1; k < model.links.size(); ++k) {
    links.push_back(model.links[k]);
    links.back().parent += kBaseJoints - 1;
  }
  unfolded_.links = std::move(links);
  unfolded_.free_base = false;
  unfolded_.home.clear();
  for (ModelFrame& f : unfolded_.frames)
    if (f.link >= 0) f.link += kBaseJoints - 1;
  for (EffectSpec& e : unfolded_.effects)
    if (find_effect(e.effect).place == Place::kTip && e.where == kBasePlace)
      e.where = names_.back();
  train_ = std::make_unique<Source>(train, *this);
  if (test) test_ = std::make_unique<Source>(*test, *this);
}

UnfoldedBase::~UnfoldedBase() = default;

const RecordingSource& UnfoldedBase::train() const { return *train_; }
const RecordingSource* UnfoldedBase::test() const { return test_.get(); }

DiagnoseOptions UnfoldedBase::unfold(const DiagnoseOptions& options) const {
  DiagnoseOptions out = options;
  for (std::string& e : out.effects)
    if (const std::size_t at = e.find('@'); at != std::string::npos &&
                                            e.substr(at + 1) == kBasePlace &&
                                            find_effect(e.substr(0, at)).place == Place::kTip)
      e = e.substr(0, at + 1) + names_.back();
  for (OwnCandidate& own : out.candidates)
    if (own.columns)
      own.columns = [of_joints = own.columns](const JointSeries& x) {
        JointSeries joints = x;
        for (RowMatX<double>* m : {&joints.q, &joints.qd, &joints.qdd, &joints.tau, &joints.total,
                                   &joints.inertia, &joints.logged})
          if (m->size() > 0) *m = RowMatX<double>(m->rightCols(m->cols() - kBaseJoints));
        return of_joints(joints);
      };
  return out;
}

void UnfoldedBase::fold(Finding& finding) const {
  const auto fold_where = [&](auto& list) {
    for (auto& entry : list)
      if (entry.where == names_.back()) entry.where = kBasePlace;
  };
  fold_where(finding.causes);
  for (Cause& c : finding.causes) {
    fold_where(c.members);
    fold_where(c.rivals);
  }
  fold_where(finding.candidates);
  fold_where(finding.refused);
  fold_where(finding.absorbed);
  fold_where(finding.model.effects);
  if (!note_.empty()) finding.notes.push_back(note_);
  std::erase_if(finding.parameters, [&](const ParameterEstimate& p) {
    return std::ranges::any_of(names_,
                               [&](const std::string& n) { return p.name.starts_with(n + "."); });
  });
  Model out = folded_;
  out.effects = std::move(finding.model.effects);
  for (std::size_t k = 0; k < out.links.size(); ++k)
    out.links[k].inertia = finding.model.links[k + kBaseJoints - 1].inertia;
  finding.model = std::move(out);
}

}  // namespace diffnea
