#pragma once
/// SIMD packs as a scalar: one state per lane. Internal: the width depends on the compiler's flags,
/// so no public header may include this, and only files that diffnea_add_isa_kernels builds may use
/// it.
///
/// `native_simd` is as wide as a register: wider packs spill (gcc 12, ABA: 65 ns a lane at 8 lanes
/// of AVX-512, 349 at 16). Its type, and so the name of every template over it, differs between
/// instruction sets.

#include <experimental/simd>

#include <diffnea/core/scalar.hpp>

namespace diffnea {

using Pack = std::experimental::native_simd<double>;
inline constexpr int kPackWidth = static_cast<int>(Pack::size());

/// A pack is its own value; what is compared with it is one bool a lane, for select().
inline const Pack& value(const Pack& a) { return a; }

/// Value in one lane: a pack as a whole cannot be looked at by a branch.
inline double value(const Pack& a, int lane) { return a[static_cast<std::size_t>(lane)]; }

/// `condition ? a : b`, lane by lane.
inline Pack select(const Pack::mask_type& condition, const Pack& a, const Pack& b) {
  Pack out = b;
  std::experimental::where(condition, out) = a;
  return out;
}

}  // namespace diffnea
