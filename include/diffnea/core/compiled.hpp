#pragma once
/// Header-only or compiled. The component `diffnea::dynamics` (core, lie, model, dynamics, the
/// formulas of effects) works from its headers alone. What links the compiled library sees
/// DIFFNEA_COMPILED, which `diffnea::identify` and all above it define for their users: templates
/// for the scalars of DIFFNEA_FOR_EACH_SCALAR are then `extern`, and functions that are no
/// templates are declared only. Without it both are compiled in the user's file, from the same
/// text: `detail/<stem>_impl.hpp`, which `src/` compiles once.

#ifdef DIFFNEA_COMPILED
#define DIFFNEA_INLINE
#else
/// Before a function of a detail/<stem>_impl.hpp that is no template.
#define DIFFNEA_INLINE inline
#endif
