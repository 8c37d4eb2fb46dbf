#pragma once

// Installed, this file's place is taken by the one that it includes.
#include "sensing/core/result.h"
