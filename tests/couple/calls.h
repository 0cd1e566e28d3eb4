/* Calls of the operations of a participant (CoupleParticipant), for tests that count them: first those of a step, in
   the order of the table. */
#pragma once

enum {
  BEGIN,
  PREPARE,
  ROWS,
  ASSEMBLE,
  START,
  SOLVED,
  FORCE,
  BALANCE,
  ENERGY,
  LIMIT,
  ADVANCE,
  MESH_UPDATED,
  CONNECT,
  LEAVE,
  DISCARD,
  ARRIVE,
  VISIT,
  VIEW,
  DESTROY,
  NCALLS
};
