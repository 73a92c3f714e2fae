#pragma once
/// Worlds by name, as the command line writes them: `mujoco:wam4,perturb=A,seed=3,noise=0`.

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <diffnea/sim/mujoco_world.hpp>

namespace diffnea {

/// A robot in MuJoCo that may differ from its description.
struct WorldSpec {
  std::filesystem::path mjcf;
  Perturbation perturbation;
  std::optional<std::uint64_t>
      seed;            ///< of the perturbation and the noise; not given: the command's
  double noise = 1.0;  ///< factor on the sensors' noise
};

/// Parses `mujoco:NAME[,key=value…]`. NAME is a path to an MJCF, or the name of a model that
/// find_model_file knows. Keys: `perturb` = none, A (default) or B; `seed`; `noise` (factor,
/// default 1).
/// @throws Error listing what there is
WorldSpec parse_world(const std::string& text);

/// Folders with the models that come with the program, in the order they are searched:
/// $DIFFNEA_MODELS, the folder share/diffnea/models beside the command or of the installation, the
/// source tree it was built from.
std::vector<std::filesystem::path> model_folders();

/// Models in those folders by name; the first folder that has a name wins.
std::map<std::string, std::filesystem::path> list_models(
    const std::vector<std::string>& extensions);

/// What `diffnea worlds` says: the worlds there are, and their keys. As JSON: schema
/// "diffnea/worlds/1".
std::string worlds_text();
std::string worlds_json();

/// `wam4` → …/wam4.xml; a path that exists is returned as it is.
/// @param extensions  those that will do, e.g. {".xml"}
/// @throws FileError listing the models there are
std::filesystem::path find_model_file(const std::string& name,
                                      const std::vector<std::string>& extensions);

}  // namespace diffnea
