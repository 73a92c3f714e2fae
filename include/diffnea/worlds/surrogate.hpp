#pragma once
/// Files of ranges that a MuJoCo world's robot is drawn from, one small JSON each (schema
/// "diffnea/surrogate/1", docs/schema/surrogate.schema.json): what `perturb=A` of a world means is
/// surrogate_a.json, found where models are found.

#include <filesystem>
#include <map>
#include <string>

#include <diffnea/sim/mujoco_world.hpp>

namespace diffnea {

/// A family of robots that stands for a real one.
struct Surrogate {
  std::string summary;  ///< one line
  Perturbation ranges;  ///< 0 where the file gives none: no change
};

/// @throws ModelError naming the key, what came and what was expected; FileError
Surrogate read_surrogate(const std::filesystem::path& path);

/// Those that come with the program, by the name that `perturb=` takes: "A" is surrogate_a.json.
std::map<std::string, std::filesystem::path> list_surrogates();

/// `none`, a name of list_surrogates, or a path that ends in .json.
/// @throws as read_surrogate; Error listing the choices
Perturbation find_surrogate(const std::string& name);

/// Masses −8…+20 %, inertias +10…+20 %, centres of mass up to 15 mm, Coulomb friction 0.6…1.5 N·m,
/// viscous 0.5…1.2 N·m·s/rad, rotors +0.03…0.1 kg·m²; a ball's string up to 8 mm longer or shorter
/// and tied up to 12 mm away, the cup tilted by up to 2°.
inline Perturbation surrogate_a() { return find_surrogate("A"); }
/// About twice that.
inline Perturbation surrogate_b() { return find_surrogate("B"); }
/// B whose drives have cables that give, stick, act late and with noise, and whose camera is late.
inline Perturbation surrogate_c() { return find_surrogate("C"); }

}  // namespace diffnea
