#pragma once
/// What learned policies did in another world as one self-contained HTML page: no network,
/// printable.

#include <string>

#include <diffnea/runs/policy_result.hpp>

namespace diffnea {

/// The page, from what read_transfer_run gives.
std::string transfer_page(const TransferRun& run);

}  // namespace diffnea
