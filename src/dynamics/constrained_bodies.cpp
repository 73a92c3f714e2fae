#include <diffnea/dynamics/detail/constraint_rows_impl.hpp>
