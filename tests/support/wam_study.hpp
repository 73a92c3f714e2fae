#pragma once
/// One draw of the study "a WAM the model does not know exactly": MuJoCo records, identify() fits,
/// and the truth, which identify() never sees, judges.

#include <cmath>
#include <map>
#include <string>

#include <diffnea/excite/fourier.hpp>
#include <diffnea/identify/identify.hpp>
#include <diffnea/core/text_file.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/worlds/surrogate.hpp>
#include <diffnea/sim/mujoco_world.hpp>

namespace diffnea::test {

struct WamDraw {
  Model nominal, truth;
  Recording train, test;
};

/// @param seed  draws the robot, both motions and the noise
inline WamDraw draw_wam(unsigned seed, double seconds) {
  const std::string path = std::string(DIFFNEA_SOURCE_DIR) + "/models/wam4.xml";
  WamDraw out;
  out.nominal = read_model(path);
  out.truth = perturbed(out.nominal, surrogate_a(), seed);
  const auto record = [&](unsigned motion) {
    FourierOptions motion_options;
    motion_options.duration = seconds;
    motion_options.seed = motion;
    RecordOptions options;
    options.seed = motion + 1000;
    const SimulatedRecording r =
        record_in_mujoco(read_text_file(path), out.truth, out.nominal,
                         random_fourier(out.nominal, motion_options), options);
    if (!r.failure.empty()) throw Error("draw_wam: " + r.failure);
    return r.recording;
  };
  out.train = record(2 * seed);
  out.test = record(2 * seed + 1);
  return out;
}

/// The truth's value of every linear parameter that `result` names; an effect the truth lacks is
/// zero.
inline std::map<std::string, double> true_parameters(const Model& truth) {
  static const char* const kNames[] = {"mass", "hx",  "hy",  "hz",  "Ixx",
                                       "Ixy",  "Ixz", "Iyy", "Iyz", "Izz"};
  std::map<std::string, double> out;
  const Tree<double> tree = make_tree(truth);
  const std::vector<int> moving = moving_links(truth);
  for (int i = 0; i < tree.num_dofs(); ++i)
    for (int k = 0; k < kThetaSize; ++k)
      out[truth.links[moving[i]].name + "." + kNames[k]] = tree.links[i].inertia.theta()[k];
  for (const EffectSpec& e : truth.effects)
    for (const EffectParameter& p : e.parameters)
      out[e.where + "." + e.effect + "." + p.name] = p.value;
  return out;
}

struct Coverage {
  int inside = 0, of = 0;
};

/// How many base parameters hold the truth in their 95 % interval.
inline Coverage coverage(const IdentifyResult& result, const Model& truth) {
  const std::map<std::string, double> values = true_parameters(truth);
  Coverage out;
  for (const BaseParameter& b : result.base_parameters) {
    double expected = 0.0;
    for (std::size_t k = 0; k < b.columns.size(); ++k) {
      const auto it = values.find(result.parameters[b.columns[k]].name);
      expected += b.coefficients[k] * (it == values.end() ? 0.0 : it->second);
    }
    ++out.of;
    if (std::abs(b.value - expected) <= 1.96 * b.std) ++out.inside;
  }
  return out;
}

}  // namespace diffnea::test
