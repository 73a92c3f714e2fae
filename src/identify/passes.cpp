#include "identify/passes.hpp"

#include <algorithm>
#include <numeric>

#include "core/c_numbers.hpp"
#include "core/constants.hpp"
#include "identify/run_effects.hpp"

namespace diffnea {

std::string format_number(double x) {
  char buffer[32];
  detail::print(buffer, sizeof buffer, "%.4g", x);
  return buffer;
}

Pass for_each_block(const RecordingSource& source, const PreprocessPlan& plan,
                    const std::string& stage, int iteration, const IdentifyOptions& options,
                    const std::function<void(const Preprocessed&)>& use) {
  Pass pass;
  Preprocessor preprocessor(plan);
  const auto take = [&](const Preprocessed& block) {
    pass.notes.insert(pass.notes.end(), block.notes.begin(), block.notes.end());
    if (block.rows() == 0) return;
    const VecX<double> low = block.q.colwise().minCoeff(), high = block.q.colwise().maxCoeff();
    pass.lowest = pass.lowest.size() == 0 ? low : VecX<double>(pass.lowest.cwiseMin(low));
    pass.highest = pass.highest.size() == 0 ? high : VecX<double>(pass.highest.cwiseMax(high));
    use(block);
  };
  std::string present;  // source and run of the recording that is being read
  source.for_each([&](const Recording& recording) {
    const std::string name = recording.source + "#" + std::to_string(recording.run);
    if (!present.empty() && name != present) take(preprocessor.finish());
    if (name != present) ++pass.runs;
    present = name;
    pass.rows += recording.rows();
    take(preprocessor.push(recording));
    if (options.progress && !options.progress({stage, iteration, pass.rows, 0.0}))
      pass.interrupted = true;
    return !pass.interrupted;
  });
  take(preprocessor.finish());
  return pass;
}

FitLayout layout_for(const Model& model, const RecordingSource& source, const RecordingSource* test,
                     const FitChoice& choice, std::vector<std::string>& notes) {
  FitChoice with_side = choice;
  with_side.link_side = source.sample().front().info.torque_side == TorqueSide::kLink;
  const bool per_run =
      choice.effects && std::ranges::any_of(*choice.effects, [](const auto& e) {
        const EffectInfo* info = known_effect(e.substr(0, e.find('@')));
        return info && std::ranges::any_of(info->parameters, &ParameterInfo::per_run);
      });
  if (!depends_on_runs(model, choice, source, test))
    return make_layout(model, with_side, per_run ? source.runs() : std::vector<int>{0});
  std::vector<RunDescription> runs = source.describe_runs();
  const int training = static_cast<int>(runs.size());
  std::vector<int> numbers(runs.size());
  std::iota(numbers.begin(), numbers.end(), 0);
  if (test)
    for (RunDescription& r : test->describe_runs()) runs.push_back(std::move(r));
  const Model held = with_held_bodies(model, runs, with_side);
  FitLayout layout = make_layout(held, with_side, numbers);
  check_runs(runs, training, model, layout, notes);
  return layout;
}

double count_free(const FitLayout& layout) {
  const auto is_free = [](const FitParameter& p) { return !p.fixed; };
  return static_cast<double>(std::ranges::count_if(layout.linear, is_free) +
                             std::ranges::count_if(layout.shape, is_free));
}

bool reads_links(const FitLayout& layout) {
  return std::ranges::any_of(
      layout.effects, [](const BoundEffect& e) { return e.info().has(Trait::kFollowsLoad); });
}

std::vector<ParameterEstimate> parameter_estimates(const FitLayout& layout, const VecX<double>& x,
                                                   const VecX<double>& shape,
                                                   const VecX<double>& std,
                                                   const std::vector<bool>& identifiable,
                                                   const std::vector<int>& at_bound,
                                                   const VecX<double>& shape_std) {
  std::vector<ParameterEstimate> out;
  for (std::size_t k = 0; k < layout.linear.size(); ++k) {
    const FitParameter& def = layout.linear[k];
    const long i = static_cast<long>(k);
    const bool bound = std::ranges::find(at_bound, static_cast<int>(k)) != at_bound.end();
    out.push_back({def.name, def.unit, x[i], std[i], def.prior, identifiable[k], def.fixed, bound});
  }
  for (std::size_t k = 0; k < layout.shape.size(); ++k) {
    const FitParameter& def = layout.shape[k];
    const long i = static_cast<long>(k);
    const double s = shape_std.size() > 0 ? shape_std[i] : 0.0;
    out.push_back({def.name, def.unit, shape[i], s, def.prior, s > 0.0, s == 0.0, false});
  }
  return out;
}

std::string unit_of_joint(const Model& model, int j, bool of_torque) {
  const ModelLink& link = model.links[moving_links(model)[static_cast<std::size_t>(j)]];
  const bool slides = link.type == ModelJoint::kPrismatic;
  if (of_torque) return slides ? "N" : "N*m";
  return slides ? "m" : "rad";
}

JointError blank_error(const Model& model, int j, bool of_torque) {
  JointError e;
  e.joint = row_name(model, j);
  e.unit = of_torque ? row_unit(model, j) : unit_of_joint(model, j, false);
  e.torque_rms = e.train = e.nominal_train = kNaN;
  e.test = e.nominal_test = e.test_all = e.test_raw = kNaN;
  return e;
}

Posterior posterior_of(const FitLayout& layout, const VecX<double>& x,
                       const MatX<double>& information, const RecordingSource& data) {
  Posterior out;
  out.recordings = fingerprints(data);
  std::vector<int> free;
  for (std::size_t k = 0; k < layout.linear.size(); ++k)
    if (!layout.linear[k].fixed) free.push_back(static_cast<int>(k));
  for (const int k : free) {
    out.names.push_back(layout.linear[static_cast<std::size_t>(k)].name);
    out.mean.push_back(x[k]);
  }
  const MatX<double> block = information(free, free);
  out.information.assign(block.data(), block.data() + block.size());
  return out;
}

std::vector<std::string> fingerprints(const RecordingSource& source) {
  std::vector<std::string> out;
  for (const RunDescription& run : source.describe_runs()) out.push_back(run.motion);
  return out;
}

}  // namespace diffnea
