/* Viscoelastic: what a viscoelastic fluid keeps; for viscoelastic.c and choose.c only, and for tests. */
#pragma once
#include "../impl.h"
#include "conformation.h"

typedef struct {
  Polymer        law;
  Conformation   conformation;
  FlowElasticity state;   /* as the last FlowDiagnose found it */
  PetscBool      tensors; /* the step has tensors in its matrix */
} Viscoelastic;

/* NULL: the fluid is another one */
Viscoelastic *FlowViscoelastic(const struct _p_Flow *);
