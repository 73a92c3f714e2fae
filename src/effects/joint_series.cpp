#include <diffnea/effects/detail/joint_series_impl.hpp>
