#include <algorithm>
#include <cmath>
#include <numeric>

#include <diffnea/core/error.hpp>
#include <diffnea/identify/source.hpp>
#include <diffnea/recording/commands.hpp>
#include <diffnea/recording/position_warnings.hpp>

#include "identify/fingerprint.hpp"
#include "identify/loop_positions.hpp"
#include "recording/floating_base.hpp"
#include "recording/unwrapper.hpp"

namespace diffnea {
namespace {

using detail::Unwrapper;

/// Rows that are read at once when a file is streamed, and that filters are chosen from.
constexpr long kBlockRows = 16384;
constexpr long kSampleRows = 4 * kBlockRows;

std::vector<ChannelWarning> find_warnings(const std::vector<JointDescription>& joints,
                                          const std::vector<Recording>& recordings) {
  std::vector<ChannelWarning> out = find_degrees(joints, recordings);
  for (auto find : {find_other_lengths, find_wrapped, find_excess_torque, find_early_responses,
                    find_twos_complement_torque})
    for (ChannelWarning& w : find(joints, recordings)) out.push_back(std::move(w));
  return out;
}

/// Name of the link that the model floats on; empty: its base is fixed.
std::string floating_link(const Model& model) {
  return model.free_base ? model.links[0].name : std::string();
}

/// The model's word that a joint is passive counts as much as the sidecar's.
/// @param unlogged  joints that may have no column: match_joints() says that they are passive
void add_passive(const std::vector<JointDescription>& joints,
                 const std::vector<std::string>& unlogged, RecordingInfo& info) {
  const auto has = [](const std::vector<std::string>& names, const std::string& name) {
    return std::ranges::find(names, name) != names.end();
  };
  for (const JointDescription& j : joints)
    if (j.passive && !has(unlogged, j.name) && !has(info.passive, j.name))
      info.passive.push_back(j.name);
}

/// Knowledge of a file: the caller's word, and the model's joints.
ReadOptions options_of(const std::vector<ReadOptions>& options, std::size_t file,
                       const std::vector<JointDescription>& joints,
                       const std::vector<std::string>& unlogged) {
  ReadOptions out = options.empty() ? ReadOptions{} : options[options.size() == 1 ? 0 : file];
  add_passive(joints, unlogged, out.info);
  out.joints = joints;
  return out;
}

class InMemory : public RecordingSource {
 public:
  InMemory(const Model& model, std::vector<Recording> recordings, ReadReport report = {})
      : recordings_(std::move(recordings)), report_(std::move(report)) {
    const std::vector<JointDescription> joints = describe_joints(model);
    std::vector<ChannelWarning> deviations;
    LoopPositions loops(model);
    for (Recording& r : recordings_) loops.complete(r);
    if (!loops.note().empty()) report_.notes.push_back(loops.note());
    match_joints(joints, recordings_, &deviations);
    std::string left_out;
    detail::match_base(floating_link(model), recordings_, &left_out);
    if (!left_out.empty()) report_.notes.push_back(left_out);
    for (std::string& note : detail::blank_impossible_poses(recordings_))
      report_.notes.push_back(std::move(note));
    for (std::size_t k = 0; k < recordings_.size(); ++k) recordings_[k].run = static_cast<int>(k);
    for (const Recording& r : recordings_) {  // as streamed files, before torques are looked at
      Fingerprint of;
      of.add(r);
      runs_.push_back({r.source, r.info, of.motion(), of.rows()});
    }
    Unwrapper unwrapper(joints, recordings_);
    for (Recording& r : recordings_) unwrapper.apply(r);
    if (const std::string note = unwrapper.note(); !note.empty()) report_.notes.push_back(note);
    for (std::string& note : blank_absurd_torque(joints, recordings_))
      report_.notes.push_back(std::move(note));
    warnings_ = find_warnings(joints, recordings_);
    warnings_.insert(warnings_.end(), deviations.begin(), deviations.end());
  }
  void for_each(const std::function<bool(const Recording&)>& use) const override {
    for (const Recording& r : recordings_)
      if (!use(r)) return;
  }
  std::vector<Recording> sample() const override { return recordings_; }
  std::vector<int> runs() const override {
    std::vector<int> out(recordings_.size());
    std::iota(out.begin(), out.end(), 0);
    return out;
  }
  std::vector<RunDescription> describe_runs() const override { return runs_; }
  bool holds_payload() const override {
    return std::ranges::any_of(recordings_,
                               [](const Recording& r) { return r.info.payload.has_value(); });
  }
  const ReadReport& report() const override { return report_; }
  const std::vector<ChannelWarning>& warnings() const override { return warnings_; }

 private:
  std::vector<Recording> recordings_;
  std::vector<RunDescription> runs_;
  ReadReport report_;
  std::vector<ChannelWarning> warnings_;
};

class InFiles : public RecordingSource {
 public:
  InFiles(const Model& model, std::vector<std::filesystem::path> paths,
          std::vector<ReadOptions> options)
      : model_(model),
        joints_(describe_joints(model)),
        floats_(floating_link(model)),
        paths_(std::move(paths)) {
    for (std::size_t f = 0; f < paths_.size(); ++f)
      options_.push_back(options_of(options, f, joints_, joints_of_loops(model)));
    std::vector<ChannelWarning> deviations;
    measured_ = first_rows(deviations);
    sample_ = measured_;
    Unwrapper(joints_, measured_).apply(sample_[0]);
    warnings_ = find_warnings(joints_, sample_);
    warnings_.insert(warnings_.end(), deviations.begin(), deviations.end());
  }
  void for_each(const std::function<bool(const Recording&)>& use) const override {
    int run = -1;
    std::string previous;
    ReadReport report;
    std::vector<RunDescription> described;
    std::vector<Fingerprint> prints;
    const bool first = runs_.empty();
    Unwrapper unwrapper(joints_, measured_);
    LoopPositions loops(model_);
    std::string left_out;
    for (std::size_t f = 0; f < paths_.size(); ++f) {
      RecordingReader reader(paths_[f], options_[f]);
      std::vector<Recording> block(1);
      int run_in_file = -1;
      while (reader.next(block[0], kBlockRows)) {
        if (run_in_file != block[0].run || previous != paths_[f]) ++run;
        run_in_file = block[0].run;
        previous = paths_[f];
        loops.complete(block[0]);
        match_joints(joints_, block);
        detail::match_base(floats_, block, &left_out);
        block[0].run = run;
        if (first && run == static_cast<int>(described.size())) {
          described.push_back({block[0].source, block[0].info, {}, {}});
          prints.emplace_back();
        }
        if (first) prints.back().add(block[0]);
        unwrapper.apply(block[0]);
        if (!use(block[0])) return;
      }
      report.add(reader.report());
    }
    if (!first) return;
    for (std::size_t k = 0; k < prints.size(); ++k) {
      described[k].motion = prints[k].motion();
      described[k].rows = prints[k].rows();
    }
    report_ = std::move(report);
    if (!loops.note().empty()) report_.notes.push_back(loops.note());
    if (!left_out.empty()) report_.notes.push_back(left_out);
    if (const std::string note = unwrapper.note(); !note.empty()) report_.notes.push_back(note);
    runs_ = std::move(described);
  }
  std::vector<Recording> sample() const override { return sample_; }
  std::vector<int> runs() const override {
    std::vector<int> out(describe_runs().size());
    std::iota(out.begin(), out.end(), 0);
    return out;
  }
  std::vector<RunDescription> describe_runs() const override {
    if (runs_.empty()) for_each([](const Recording&) { return true; });
    return runs_;
  }
  bool holds_payload() const override {
    return std::ranges::any_of(options_,
                               [](const ReadOptions& o) { return o.info.payload.has_value(); });
  }
  const ReadReport& report() const override { return report_; }
  const std::vector<ChannelWarning>& warnings() const override { return warnings_; }

 private:
  /// The first rows, the blocks of one run joined.
  std::vector<Recording> first_rows(std::vector<ChannelWarning>& deviations) const {
    std::vector<Recording> out;
    RecordingReader reader(paths_.front(), options_[0]);
    std::vector<Recording> block(1);
    if (!reader.next(block[0], kSampleRows)) throw DataError(paths_.front().string() + ": no rows");
    LoopPositions(model_).complete(block[0]);
    match_joints(joints_, block, &deviations);
    detail::match_base(floats_, block);
    block[0].run = 0;
    out.push_back(block[0]);
    return out;
  }

  Model model_;
  std::vector<JointDescription> joints_;
  std::string floats_;  ///< link that the model floats on; empty: none
  std::vector<std::filesystem::path> paths_;
  std::vector<ReadOptions> options_;
  std::vector<Recording> measured_, sample_;  ///< the first rows; with whole turns added
  /// Of the first pass that came to the end; later ones read the same.
  ///@{
  mutable ReadReport report_;
  mutable std::vector<RunDescription> runs_;
  ///@}
  std::vector<ChannelWarning> warnings_;
};

}  // namespace

std::vector<JointDescription> describe_joints(const Model& model) {
  std::vector<JointDescription> out;
  for (const int i : moving_links(model)) {
    const ModelLink& l = model.links[i];
    const bool endless =
        l.type == ModelJoint::kRevolute && std::isinf(l.limits.lower) && std::isinf(l.limits.upper);
    out.push_back({l.joint, l.type == ModelJoint::kPrismatic, l.passive, endless, l.limits.lower,
                   l.limits.upper, l.limits.velocity, l.limits.effort});
  }
  for (const TreeJoint& j : tree_joints(model))
    if (j.follows) out[j.drive.dof].followers.push_back({j.name, j.drive.ratio, j.drive.offset});
  return out;
}

std::unique_ptr<RecordingSource> recordings_in_memory(const Model& model,
                                                      std::vector<Recording> recordings) {
  if (recordings.empty()) throw DataError("recordings: got none, expected at least one");
  return std::make_unique<InMemory>(model, std::move(recordings));
}

std::unique_ptr<RecordingSource> recordings_in_files(
    const Model& model, const std::vector<std::filesystem::path>& paths,
    const std::vector<ReadOptions>& options, long keep_bytes) {
  if (paths.empty()) throw DataError("recordings: got no file, expected at least one");
  long bytes = 0;
  for (const auto& path : paths) {
    std::error_code error;
    const auto size = std::filesystem::file_size(path, error);
    if (!error) bytes += static_cast<long>(size);
  }
  if (bytes > keep_bytes) return std::make_unique<InFiles>(model, paths, options);
  const std::vector<JointDescription> joints = describe_joints(model);
  std::vector<Recording> all;
  ReadReport report;
  for (std::size_t f = 0; f < paths.size(); ++f) {
    ReadReport one;
    for (Recording& r :
         read_recordings(paths[f], options_of(options, f, joints, joints_of_loops(model)), &one))
      all.push_back(std::move(r));
    report.add(one);
  }
  return std::make_unique<InMemory>(model, std::move(all), report);
}

}  // namespace diffnea
