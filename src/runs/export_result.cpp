#include <diffnea/runs/export_result.hpp>

#include "runs/fields_json.hpp"
#include "runs/printed.hpp"

namespace diffnea {

std::string export_result_json(const std::filesystem::path& from, const std::filesystem::path& to,
                               const std::vector<std::string>& left_out) {
  const std::string extension = to.extension().string();
  const ExportedFile out{.from = from.string(),
                         .to = to.string(),
                         .format = extension == ".json"   ? "json"
                                   : extension == ".urdf" ? "urdf"
                                                          : "mjcf",
                         .left_out = left_out};
  return io::file_text("diffnea/export/1", out, kInResult);
}

}  // namespace diffnea
