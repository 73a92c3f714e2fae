#pragma once
/// The recordings of a source one by one, whole. Internal to identify/.

#include <functional>

#include <diffnea/identify/source.hpp>

namespace diffnea {

/// Calls `use` with every recording of which `wanted` says so, the blocks of one joined.
void for_each_run(const RecordingSource& source,
                  const std::function<bool(const Recording&)>& wanted,
                  const std::function<void(const Recording&)>& use);

}  // namespace diffnea
