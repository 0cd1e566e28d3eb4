/* Shape, ranks: those that load shapes together (see shape.h). */
#include "compat.h"
#include "base/runcomm.h"
#include "shape.h"

MPI_Comm ShapeComm(void)
{
  return RunComm();
}
