#pragma once
/// Inlining of whole recursions.

#include <diffnea/core/scalar.hpp>

namespace diffnea {

/// Whether T is a ceres::Jet, of whatever inner scalar and width.
template <class T>
inline constexpr bool kIsJet = false;
template <class T, int N>
inline constexpr bool kIsJet<ceres::Jet<T, N>> = true;

// Not under a sanitizer or without optimisation: gcc 12 then takes a quarter of an hour over a
// flattened recursion on packs.
#if defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(undefined_behavior_sanitizer)
#define DIFFNEA_NO_FLATTEN
#endif
#endif
#if defined(__SANITIZE_ADDRESS__) || !defined(__OPTIMIZE__) || defined(DIFFNEA_NO_FLATTEN)
#define DIFFNEA_FLATTEN
#else
#define DIFFNEA_FLATTEN [[gnu::flatten]]
#endif

namespace detail {

template <class F>
DIFFNEA_FLATTEN void call_flattened(const F& f) {
  f();
}

}  // namespace detail

#undef DIFFNEA_FLATTEN
#undef DIFFNEA_NO_FLATTEN

/// f(), for scalar R with all that it calls inlined: the small values of lie/ then live in
/// registers (gcc 12, 7 links: RNEA 313 → 258 ns, ABA 696 → 525 ns). Not for Jets, whose code would
/// grow by megabytes and gain nothing.
template <class R, class F>
void call_inlined(const F& f) {
  if constexpr (kIsJet<R>)
    f();
  else
    detail::call_flattened(f);
}

}  // namespace diffnea
