#pragma once
/// Header-only or compiled. The component `diffnea::dynamics` works from its headers alone. What
/// links a compiled component sees DIFFNEA_COMPILED, which `diffnea::identify` and all above it
/// define for their users: templates are then `extern` for the scalars of DIFFNEA_FOR_EACH_SCALAR,
/// and functions that are no templates are declared only. Without it the user's file compiles both,
/// from the same text: detail/NAME_impl.hpp, which src/ compiles once.

/// Before a function that is no template in a detail/NAME_impl.hpp.
#ifdef DIFFNEA_COMPILED
#define DIFFNEA_INLINE
#else
#define DIFFNEA_INLINE inline
#endif
