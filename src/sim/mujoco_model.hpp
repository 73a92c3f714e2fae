#pragma once
/// MuJoCo's objects as values that free themselves, and its compiler fed from memory: MuJoCo opens
/// no file of its own accord.

#include <functional>
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

/// Name of a line of the document in messages; empty: none.
using LineName = std::function<std::string(int line)>;

/// Compiles an MJCF document.
/// @param files  what the document names; the document itself is added
/// @param line_name  of the document's lines; by default their numbers
/// @throws ModelError `where: …` with MuJoCo's words
MujocoModel compile_mujoco(std::string_view mjcf, MujocoFiles& files, const std::string& where,
                           const LineName& line_name = {});

}  // namespace diffnea::sim
