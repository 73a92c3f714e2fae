#include <diffnea/dynamics/detail/derivatives_impl.hpp>
