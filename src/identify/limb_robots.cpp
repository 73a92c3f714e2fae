#include "identify/limb_robots.hpp"

#include <algorithm>
#include <mutex>

#include <diffnea/model/lock.hpp>
#include <diffnea/recording/joints.hpp>

#include "identify/fix_pattern.hpp"

namespace diffnea {
namespace {

/// Recordings with some of their joints, and of what the robot held, what hangs on these.
class OfJoints : public RecordingSource {
 public:
  /// @param has_tip  the whole robot's last moving link is theirs
  OfJoints(const RecordingSource& whole, std::vector<JointDescription> joints, bool has_tip)
      : whole_(whole), joints_(std::move(joints)), has_tip_(has_tip) {}

  void for_each(const std::function<bool(const Recording&)>& use) const override {
    whole_.for_each([&](const Recording& r) {
      std::vector<Recording> one{r};
      cut(one);
      return use(one.front());
    });
  }
  std::vector<Recording> sample() const override {
    std::vector<Recording> out = whole_.sample();
    cut(out);
    return out;
  }
  std::vector<int> runs() const override { return whole_.runs(); }
  std::vector<RunDescription> describe_runs() const override {
    std::vector<RunDescription> out = whole_.describe_runs();
    for (RunDescription& run : out) cut(run.info);
    return out;
  }
  bool holds_payload() const override {
    return std::ranges::any_of(describe_runs(),
                               [](const RunDescription& r) { return r.info.payload.has_value(); });
  }
  const ReadReport& report() const override { return whole_.report(); }
  const std::vector<ChannelWarning>& warnings() const override { return whole_.warnings(); }

 private:
  void cut(RecordingInfo& info) const {
    if (!info.payload) return;
    const std::string& where = info.payload->where;
    const bool here = where == "tip" ? has_tip_
                                     : std::ranges::find(joints_, where, &JointDescription::name) !=
                                           joints_.end();
    if (!here) info.payload.reset();
  }
  void cut(std::vector<Recording>& recordings) const {
    match_joints(joints_, recordings);
    for (Recording& r : recordings) cut(r.info);
  }

  const RecordingSource& whole_;
  std::vector<JointDescription> joints_;
  bool has_tip_;
};

/// Tells whether an effect is of no joint and no link: of the whole robot.
bool is_of_all(const BoundEffect& e) { return e.joints.empty() && e.links.empty(); }

}  // namespace

LimbRobot::LimbRobot(const Model& whole, const FitLayout& layout, const Limb& limb)
    : part_(make_tree(whole), limb),
      has_tip_(limb.first + limb.count == layout.num_dofs),
      model_(whole) {
  std::erase_if(model_.effects, [&](const EffectSpec& spec) {
    const auto bound = std::ranges::find_if(layout.effects, [&](const BoundEffect& e) {
      return e.info().name == spec.effect && e.where == spec.where;
    });
    return bound != layout.effects.end() && !is_of_all(*bound) && !part_.has(*bound);
  });
  const std::vector<std::string> joints = joint_names(whole);
  for (int j = 0; j < static_cast<int>(joints.size()); ++j) {
    const std::string& name = joints[static_cast<std::size_t>(j)];
    if (j < limb.first || j >= limb.first + limb.count)
      lock_joint(model_, name, resting_position(model_, name));
  }
  const std::vector<int> of_tree = tree_links(whole);
  std::vector<bool> is_moved(whole.links.size(), false);
  for (int i = 0; i < static_cast<int>(whole.links.size()); ++i) {
    const int parent = whole.links[static_cast<std::size_t>(i)].parent;
    const auto at = std::ranges::find(of_tree, i);
    const bool moved = at != of_tree.end()
                           ? part_.link(static_cast<int>(at - of_tree.begin())) >= 0
                           : parent >= 0 && is_moved[static_cast<std::size_t>(parent)];
    is_moved[static_cast<std::size_t>(i)] = moved;
    if (moved) links_.push_back(i);
  }
}

bool LimbRobot::has(const FitLayout& layout, const FitParameter& p) const {
  return p.effect >= 0 ? part_.has(layout.effects[static_cast<std::size_t>(p.effect)])
                       : part_.link(p.dof) >= 0;
}

FitChoice LimbRobot::choice(const FitLayout& layout, const FitChoice& whole) const {
  FitChoice out = whole;
  const auto is_of_model = [&](const BoundEffect& e) {
    return std::ranges::any_of(model_.effects, [&](const EffectSpec& s) {
      return s.effect == e.info().name && s.where == e.where;
    });
  };
  out.effects.emplace();
  for (const BoundEffect& e : layout.effects)
    if ((part_.has(e) || is_of_all(e)) && (whole.effects || !is_of_model(e)))
      out.effects->push_back(e.info().name + "@" + e.where);
  std::erase_if(out.fix, [&](const std::string& entry) {
    const std::string pattern = split_value(entry).first;
    const auto is_meant = [&](const FitParameter& p) {
      return has(layout, p) && matches(pattern, p.name);
    };
    return std::ranges::none_of(layout.linear, is_meant) &&
           std::ranges::none_of(layout.shape, is_meant);
  });
  return out;
}

std::unique_ptr<RecordingSource> LimbRobot::recordings(const RecordingSource& whole) const {
  return std::make_unique<OfJoints>(whole, describe_joints(model_), has_tip_);
}

void LimbRobot::put(const Model& fitted, Model& whole) const {
  for (const int i : links_)
    whole.links[static_cast<std::size_t>(i)].inertia =
        fitted.links[static_cast<std::size_t>(i)].inertia;
  for (const EffectSpec& e : fitted.effects) {
    const auto it = std::ranges::find_if(whole.effects, [&](const EffectSpec& s) {
      return s.effect == e.effect && s.where == e.where;
    });
    if (it != whole.effects.end())
      *it = e;
    else
      whole.effects.push_back(e);
  }
}

std::vector<LimbRobot> limb_robots(const Model& model, const FitLayout& layout,
                                   const MotionData& data, std::vector<BoundEffect> more) {
  const auto moves_links = [](const FitParameter& s) { return s.kinematic >= 0; };
  std::vector<Limb> parts{{0, layout.num_dofs}};
  if (!model.ball && std::ranges::none_of(layout.shape, moves_links)) {
    more.insert(more.end(), layout.effects.begin(), layout.effects.end());
    parts = limbs(extend(model, data.runs, data.runs.front()), more);
  }
  const auto moves = [&](const Limb& l, const std::vector<MotionStretch>& stretches) {
    const std::vector<int> still = still_joints(stretches, data.noise);
    for (int j = l.first; j < l.first + l.count; ++j)
      if (std::ranges::find(still, j) == still.end()) return true;
    return stretches.empty();
  };
  const auto tells = [&](const Limb& l) { return moves(l, data.train) && moves(l, data.test); };
  std::vector<Limb> fitted;
  for (const Limb& l : parts) {
    if (!fitted.empty() && !(tells(l) && tells(fitted.back())))
      fitted.back().count += l.count;
    else
      fitted.push_back(l);
  }
  std::vector<LimbRobot> out;
  for (const Limb& l : fitted) out.emplace_back(model, layout, l);
  return out;
}

std::function<bool(const FitProgress&)> shared_progress(
    const std::function<bool(const FitProgress&)>& progress) {
  if (!progress) return {};
  struct Shared {
    std::mutex one_at_a_time;
    bool stopped = false;
  };
  return [&progress, shared = std::make_shared<Shared>()](const FitProgress& p) {
    const std::scoped_lock lock(shared->one_at_a_time);
    shared->stopped = shared->stopped || !progress(p);
    return !shared->stopped;
  };
}

}  // namespace diffnea
