#include <diffnea/effects/detail/residual_impl.hpp>
