#include <diffnea/model/detail/physical_values_impl.hpp>
