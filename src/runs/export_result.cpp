#include <diffnea/runs/export_result.hpp>

#include "io/json.hpp"

namespace diffnea {

std::string export_result_json(const std::filesystem::path& from, const std::filesystem::path& to,
                               const std::vector<std::string>& left_out) {
  const std::string extension = to.extension().string();
  const io::Json json = {{"schema", "diffnea/export/1"},
                         {"from", from.string()},
                         {"to", to.string()},
                         {"format", extension == ".json"   ? "json"
                                    : extension == ".urdf" ? "urdf"
                                                           : "mjcf"},
                         {"left_out", left_out}};
  return json.dump(1, ' ', false, io::Json::error_handler_t::replace) + "\n";
}

}  // namespace diffnea
