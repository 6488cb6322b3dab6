// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "firmware_tools/simulation/room_builder.h"

// What furnishes each kind of room. Kinds keep what makes them one (a cafe has a counter and
// menus); how many of what, how large, where and of what look is drawn.
namespace viewfix::simulation {

void Cafe(RoomBuilder& b);
void Hallway(RoomBuilder& b);
void Stairs(RoomBuilder& b);
void Lobby(RoomBuilder& b);
// Two of these differ in what they show, hardly in how: their layout streams are equal.
void ShowWindow(RoomBuilder& b, int number);
void BookShelf(RoomBuilder& b);
void VideoRoom(RoomBuilder& b);
void SpecialRoom(RoomBuilder& b);
void Exhibit(RoomBuilder& b);

void Office(RoomBuilder& b);
void Classroom(RoomBuilder& b);
void Store(RoomBuilder& b);
void Lockers(RoomBuilder& b);
void Workshop(RoomBuilder& b);

// The building's walls, or a covering of this room alone.
Covering RoomWalls(RoomBuilder& b);
TexturePtr RoomFloor(RoomBuilder& b);
// Both of them around the room.
void OwnShell(RoomBuilder& b, float brightness = 1);
// Word after word in capitals, as on signs.
std::string Capitals(std::string text);

}  // namespace viewfix::simulation
