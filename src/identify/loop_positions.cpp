#include "identify/loop_positions.hpp"

#include <algorithm>

#include <diffnea/core/error.hpp>
#include <diffnea/core/text.hpp>

#include "core/constants.hpp"

namespace diffnea {
namespace {

bool has(const std::vector<std::string>& names, const std::string& name) {
  return std::ranges::find(names, name) != names.end();
}

/// The model without what positions of joints do not tell: the way of its wheels, the pose of a
/// base that floats and what ties it to the world.
Model loops_of(Model model) {
  std::erase_if(model.constraints, [&](const ConstraintSpec& c) {
    const bool to_world = c.first.link < 0 || c.second.link < 0;
    return c.kind == ConstraintKind::kRolling || (model.free_base && to_world);
  });
  model.free_base = false;
  return model;
}

}  // namespace

std::vector<std::string> joints_of_loops(const Model& model) {
  std::vector<std::string> out;
  if (loops_of(model).constraints.empty()) return out;
  for (const int i : moving_links(model))
    if (model.links[static_cast<std::size_t>(i)].passive)
      out.push_back(model.links[static_cast<std::size_t>(i)].joint);
  return out;
}

LoopPositions::LoopPositions(const Model& model)
    : model_(loops_of(model)), joints_(joint_names(model)) {}

void LoopPositions::complete(Recording& r) {
  std::vector<std::string> missing = joints_of_loops(model_);
  std::erase_if(missing, [&](const std::string& name) { return has(r.joint_names, name); });
  if (missing.empty()) return;
  for (const std::string& name : joints_)  // match_joints() says it
    if (!has(missing, name) && !has(r.joint_names, name)) return;
  if (!loops_ || added_ != missing) {
    Model logged = model_;
    for (ModelLink& link : logged.links) link.passive = has(missing, link.joint);
    loops_.emplace("positions of " + detail::join(missing) + ", which are not logged", logged);
    added_ = missing;
    source_.clear();
  }
  if (source_ != r.source) posture_ = loops_->home();
  source_ = r.source;
  std::vector<long> from;  // column of the recording per leading joint
  for (const int j : loops_->leads())
    from.push_back(std::ranges::find(r.joint_names, joints_[static_cast<std::size_t>(j)]) -
                   r.joint_names.begin());
  RowMatX<double> all = RowMatX<double>::Constant(r.rows(), loops_->num_joints(), kNaN);
  for (long k = 0; k < r.rows(); ++k) {
    const VecX<double> y = r.q.row(k)(from).transpose();
    if (!y.allFinite()) continue;
    if (!loops_->move(y, posture_))
      throw DataError(r.source + ": at " + detail::number_text(r.time[k]) + " s the loops of '" +
                      model_.name + "' do not close, or are at a dead point, with " +
                      loops_->leads_text(posture_) + " and on to the logged positions; log " +
                      detail::join(missing) + ", correct the model's lengths or the zeros of the " +
                      "encoders, or leave that part out");
    all.row(k) = posture_.transpose();
  }
  const long logged = r.num_joints(), added = static_cast<long>(missing.size());
  for (const auto member : kJointSeries) {
    RowMatX<double>& m = r.*member;
    if (m.size() == 0) continue;
    m.conservativeResize(Eigen::NoChange, logged + added);
    m.rightCols(added).setConstant(kNaN);
  }
  for (const std::string& name : missing) {
    const long j = std::ranges::find(joints_, name) - joints_.begin();
    r.q.col(r.num_joints()) = all.col(j);
    r.joint_names.push_back(name);
    r.has_tau.push_back(false);
  }
}

std::string LoopPositions::note() const {
  return added_.empty() ? ""
                        : detail::join(added_) + (added_.size() == 1 ? " has" : " have") +
                              " no column of positions: they follow from the other joints', by "
                              "the lengths of the loops";
}

}  // namespace diffnea
