#pragma once
/// MuJoCo's objects as values that free themselves, and its compiler fed from memory: MuJoCo opens
/// no file of its own accord.

#include <memory>
#include <string>
#include <string_view>

#include <mujoco/mujoco.h>

namespace diffnea::sim {

struct DeleteMujocoModel {
  void operator()(mjModel* m) const { mj_deleteModel(m); }
};
struct DeleteMujocoData {
  void operator()(mjData* d) const { mj_deleteData(d); }
};
using MujocoModel = std::unique_ptr<mjModel, DeleteMujocoModel>;
using MujocoData = std::unique_ptr<mjData, DeleteMujocoData>;

/// Files that MuJoCo's compiler may read, by flat names. 2 MB of table, hence on the heap.
class MujocoFiles {
 public:
  MujocoFiles();
  ~MujocoFiles();
  MujocoFiles(const MujocoFiles&) = delete;
  MujocoFiles& operator=(const MujocoFiles&) = delete;

  /// @throws ModelError `where: …` if there are too many
  void add(const std::string& name, std::string_view content, const std::string& where);
  const mjVFS* get() const { return vfs_.get(); }

 private:
  std::unique_ptr<mjVFS> vfs_;
};

/// Compiles an MJCF document.
/// @param files  what the document names; the document itself is added
/// @throws ModelError `where: …` with MuJoCo's words
MujocoModel compile_mujoco(std::string_view mjcf, MujocoFiles& files, const std::string& where);

}  // namespace diffnea::sim
