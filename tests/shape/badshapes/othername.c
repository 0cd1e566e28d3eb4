/* Registers a type that is not the name of its file. */
#include "shape.h"

TUMBLE_SHAPE_REGISTER = {.interface = SHAPE_INTERFACE, .type = "cube", .dims = 3};
