#include "diffnea/version.hpp"

namespace diffnea {

std::string_view version() noexcept { return kVersion; }

}  // namespace diffnea
