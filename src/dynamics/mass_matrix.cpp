#include <diffnea/dynamics/mass_matrix.hpp>

namespace diffnea {

#define DIFFNEA_INSTANTIATE(P, S)                                              \
  template const MatX<Prod<P, S>>& mass_matrix<P, S>(const Tree<P>&, VecIn<S>, \
                                                     MassMatrixWorkspace<P, S>&);
DIFFNEA_FOR_EACH_SCALAR(DIFFNEA_INSTANTIATE)

}  // namespace diffnea
