#pragma once
/// A small arm in MuJoCo that a test writes down itself: its description, and recordings of a robot
/// that has more than it says.

#include <string>
#include <support/temporary_folder.hpp>
#include <vector>

#include <diffnea/core/error.hpp>
#include <diffnea/excite/fourier.hpp>
#include <diffnea/core/text_file.hpp>
#include <diffnea/io/model_file.hpp>
#include <diffnea/sim/mujoco_world.hpp>

namespace diffnea::test {

class MujocoArm {
 public:
  explicit MujocoArm(std::string mjcf) : mjcf_(std::move(mjcf)) {
    const TemporaryFolder folder;
    write_file_atomically(folder.path() / "arm.xml", mjcf_);
    nominal = read_model(folder.path() / "arm.xml");
  }
  /// 30 s of a random motion. @param hidden  effects, which become its joints' frictionloss,
  /// armature or torque
  Recording recorded(const std::vector<EffectSpec>& hidden, unsigned seed) const {
    Model truth = nominal;
    truth.effects = hidden;
    FourierOptions motion;
    motion.seed = seed;
    motion.duration = 30.0;
    RecordOptions options;
    options.seed = seed + 1000;
    const SimulatedRecording r =
        record_in_mujoco(mjcf_, truth, nominal, random_fourier(nominal, motion), options);
    if (!r.failure.empty()) throw Error(r.failure);
    return r.recording;
  }
  Model nominal;

 private:
  std::string mjcf_;
};

}  // namespace diffnea::test
