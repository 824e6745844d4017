//! The stack machine that a pickle is a program of, without the part that calls anything.

use super::class::Class;
use super::construct;
use super::input::{Input, raw_unicode, unquoted};
use super::value::{Bytes, Heap, Node, Value, decoded};
use skinsplat_core::scene::SceneError;
use std::collections::HashMap;

/// The state of a run. Every opcode takes at least one byte of the file and adds a bounded number of values, so that
/// memory is bounded by the file's length.
struct Machine {
    heap: Heap,
    input: Input,
    stack: Vec<Value>,
    /// Heights of the stack at the open marks.
    marks: Vec<usize>,
    memo: HashMap<u64, Value>,
    /// The file is one of torch: storages may lie outside, and torch's names are known.
    of_torch: bool,
}

/// Runs the program that starts at byte `start` of a file, and gives its result.
pub(super) fn run(file: Vec<u8>, start: usize, of_torch: bool) -> Result<(Heap, Value), SceneError> {
    let mut machine = Machine {
        heap: Heap::new(file),
        input: Input { at: start },
        stack: Vec::new(),
        marks: Vec::new(),
        memo: HashMap::new(),
        of_torch,
    };
    loop {
        let at = machine.input.at;
        let opcode = machine.input.byte(&machine.heap.file)?;
        if opcode == b'.' {
            let result = machine.pop()?;
            return Ok((machine.heap, result));
        }
        machine.step(opcode, at)?;
    }
}

fn broken(problem: impl Into<String>) -> SceneError {
    SceneError::new("pickle", problem, "a Python pickle of protocol 0 to 5")
}

impl Machine {
    fn pop(&mut self) -> Result<Value, SceneError> {
        let floor = self.marks.last().copied().unwrap_or(0);
        if self.stack.len() <= floor {
            return Err(broken("an opcode without its operand"));
        }
        self.stack.pop().ok_or_else(|| broken("an opcode without its operand"))
    }

    fn top(&self) -> Result<Value, SceneError> {
        self.stack.last().copied().ok_or_else(|| broken("an opcode without its operand"))
    }

    /// What lies above the last mark, which goes with it.
    fn pop_mark(&mut self) -> Result<Vec<Value>, SceneError> {
        let height = self.marks.pop().ok_or_else(|| broken("an opcode without its mark"))?;
        Ok(self.stack.split_off(height.min(self.stack.len())))
    }

    fn push(&mut self, node: Node) -> Result<(), SceneError> {
        let value = self.heap.push(node)?;
        self.stack.push(value);
        Ok(())
    }

    fn number(&mut self, value: Value) -> Result<(), SceneError> {
        self.stack.push(value);
        Ok(())
    }

    fn step(&mut self, opcode: u8, at: usize) -> Result<(), SceneError> {
        match opcode {
            0x80 => self.protocol(),
            0x95 => self.input.take(&self.heap.file, 8).map(|_| ()),
            b'(' => {
                self.marks.push(self.stack.len());
                Ok(())
            }
            b'0' => self.discard(),
            b'1' => self.pop_mark().map(|_| ()),
            b'2' => {
                let top = self.top()?;
                self.number(top)
            }
            b'N' | b'I' | b'J' | b'K' | b'M' | b'L' | b'F' | b'G' | 0x88..=0x8b => self.scalar(opcode),
            b'S' | b'T' | b'U' | b'V' | b'X' | b'B' | b'C' | 0x8c..=0x8e | 0x96 => self.string(opcode),
            b']' | 0x8f | b')' | b'}' | b'l' | b't' | b'd' | 0x85..=0x87 | 0x91 => self.collection(opcode),
            b'a' | b'e' | b's' | b'u' | 0x90 => self.fill(opcode),
            b'p' | b'q' | b'r' | 0x94 => self.remember(opcode),
            b'g' | b'h' | b'j' => self.recall(opcode),
            b'c' | 0x93 | b'i' | b'o' | b'R' | 0x81 | 0x92 | b'b' => self.object(opcode),
            b'Q' if self.of_torch => {
                let id = self.pop()?;
                let storage = construct::storage(&mut self.heap, id)?;
                self.number(storage)
            }
            b'P' | b'Q' => Err(broken("a persistent id, which stands for something outside the file")),
            0x82..=0x84 => Err(broken("an extension code, which stands for a class outside the file")),
            0x97 | 0x98 => Err(broken("a buffer outside the file")),
            _ => Err(broken(format!("byte {opcode:#04x} at {at}, which is no opcode"))),
        }
    }

    fn protocol(&mut self) -> Result<(), SceneError> {
        match self.input.byte(&self.heap.file)? {
            0..=5 => Ok(()),
            other => Err(broken(format!("protocol {other}"))),
        }
    }

    /// `POP`: a value, or the mark if nothing lies above it.
    fn discard(&mut self) -> Result<(), SceneError> {
        if self.marks.last() == Some(&self.stack.len()) {
            self.marks.pop();
            return Ok(());
        }
        self.pop().map(|_| ())
    }

    fn scalar(&mut self, opcode: u8) -> Result<(), SceneError> {
        let (input, file) = (&mut self.input, &self.heap.file);
        let value = match opcode {
            b'N' => Value::None,
            0x88 => Value::Bool(true),
            0x89 => Value::Bool(false),
            b'J' => Value::Int(i32::from_le_bytes(input.array(file)?).into()),
            b'K' => Value::Int(input.byte(file)?.into()),
            b'M' => Value::Int(u16::from_le_bytes(input.array(file)?).into()),
            b'G' => Value::Float(f64::from_be_bytes(input.array(file)?)),
            0x8a | 0x8b => {
                let range = input.counted(file, if opcode == 0x8a { 1 } else { 4 })?;
                match long(&file[range]) {
                    Some(value) => value,
                    None => return self.push(Node::Other("an integer beyond 64 bits")),
                }
            }
            b'F' => {
                let text = input.text_line(file)?;
                let Ok(number) = text.trim().parse() else {
                    return Err(broken(format!("{text:?} as a number")));
                };
                Value::Float(number)
            }
            _ => match whole(input.text_line(file)?, opcode == b'I')? {
                Some(value) => value,
                None => return self.push(Node::Other("an integer beyond 64 bits")),
            },
        };
        self.number(value)
    }

    fn string(&mut self, opcode: u8) -> Result<(), SceneError> {
        let (input, file) = (&mut self.input, &self.heap.file);
        let node = match opcode {
            b'S' => {
                let line = input.line(file)?;
                let bytes = unquoted(&file[line]).ok_or_else(|| broken("a quoted string that is none"))?;
                Node::Bytes(Bytes::Owned(bytes.into()))
            }
            b'V' => {
                let line = input.line(file)?;
                Node::Text(raw_unicode(&file[line]).ok_or_else(|| broken("text with a broken escape"))?)
            }
            b'U' | b'C' => Node::Bytes(Bytes::Slice(input.counted(file, 1)?)),
            b'T' | b'B' => Node::Bytes(Bytes::Slice(input.counted(file, 4)?)),
            0x8e | 0x96 => Node::Bytes(Bytes::Slice(input.counted(file, 8)?)),
            0x8c => Node::Text(decoded(&file[input.counted(file, 1)?])),
            b'X' => Node::Text(decoded(&file[input.counted(file, 4)?])),
            _ => Node::Text(decoded(&file[input.counted(file, 8)?])),
        };
        self.push(node)
    }

    fn collection(&mut self, opcode: u8) -> Result<(), SceneError> {
        let node = match opcode {
            b']' | 0x8f => Node::List(Vec::new()),
            b')' => Node::Tuple(Vec::new()),
            b'}' => Node::Dict(Vec::new()),
            b'l' | 0x91 => Node::List(self.pop_mark()?),
            b't' => Node::Tuple(self.pop_mark()?),
            b'd' => Node::Dict(pairs(&self.pop_mark()?)?),
            _ => {
                let count = usize::from(opcode - 0x84);
                let mut items = vec![Value::None; count];
                for item in items.iter_mut().rev() {
                    *item = self.pop()?;
                }
                Node::Tuple(items)
            }
        };
        self.push(node)
    }

    /// `APPEND(S)`, `SETITEM(S)`, `ADDITEMS`.
    fn fill(&mut self, opcode: u8) -> Result<(), SceneError> {
        let values = match opcode {
            b'a' => vec![self.pop()?],
            b's' => {
                let value = self.pop()?;
                vec![self.pop()?, value]
            }
            _ => self.pop_mark()?,
        };
        let into = self.top()?;
        match (self.heap.get_mut(into), opcode) {
            (Some(Node::List(items)), b'a' | b'e' | 0x90) => items.extend(values),
            (Some(Node::Dict(own)), b's' | b'u') => own.extend(pairs(&values)?),
            _ => {
                let problem = format!("items put into {}", self.heap.describe(into));
                return Err(broken(problem));
            }
        }
        Ok(())
    }

    fn remember(&mut self, opcode: u8) -> Result<(), SceneError> {
        let key = match opcode {
            0x94 => self.memo.len() as u64,
            _ => self.memo_key(opcode == b'p', opcode == b'q')?,
        };
        let top = self.top()?;
        self.memo.insert(key, top);
        Ok(())
    }

    fn recall(&mut self, opcode: u8) -> Result<(), SceneError> {
        let key = self.memo_key(opcode == b'g', opcode == b'h')?;
        let value =
            self.memo.get(&key).copied().ok_or_else(|| broken(format!("memo {key}, which is empty")))?;
        self.number(value)
    }

    fn memo_key(&mut self, text: bool, short: bool) -> Result<u64, SceneError> {
        let file = &self.heap.file;
        if text {
            let line = self.input.text_line(file)?;
            return match line.trim().parse() {
                Ok(number) => Ok(number),
                Err(_) => Err(broken(format!("{line:?} as the number of a memo"))),
            };
        }
        if short {
            return Ok(self.input.byte(file)?.into());
        }
        Ok(u32::from_le_bytes(self.input.array(file)?).into())
    }

    /// Classes and what is made of them.
    fn object(&mut self, opcode: u8) -> Result<(), SceneError> {
        match opcode {
            b'c' | 0x93 => {
                let class = self.class(opcode == b'c')?;
                self.push(Node::Class(class))
            }
            b'i' => {
                let class = self.class(true)?;
                let arguments = self.pop_mark()?;
                self.construct(class, &arguments)
            }
            b'o' => {
                let values = self.pop_mark()?;
                let (&first, arguments) =
                    values.split_first().ok_or_else(|| broken("an object without its class"))?;
                self.construct(self.class_of(first)?, arguments)
            }
            b'b' => self.build(),
            _ => {
                if opcode == 0x92 {
                    self.pop()?;
                }
                let (arguments, class) = (self.pop()?, self.pop()?);
                let class = self.class_of(class)?;
                let arguments = self.heap.items(arguments).map(<[Value]>::to_vec);
                let arguments = arguments.ok_or_else(|| broken("arguments that are no tuple"))?;
                self.heap.charge(arguments.len())?;
                self.construct(class, &arguments)
            }
        }
    }

    fn class(&mut self, lines: bool) -> Result<Class, SceneError> {
        if lines {
            let module = self.input.line(&self.heap.file)?;
            let name = self.input.line(&self.heap.file)?;
            let file = &self.heap.file;
            return self.named(&decoded(&file[module]), &decoded(&file[name]));
        }
        let (name, module) = (self.pop()?, self.pop()?);
        match (self.heap.text(module), self.heap.text(name)) {
            (Some(module), Some(name)) => self.named(&module, &name),
            _ => Err(broken("a class without a name")),
        }
    }

    fn named(&self, module: &str, name: &str) -> Result<Class, SceneError> {
        if self.of_torch { Class::named_by_torch(module, name) } else { Class::named(module, name) }
    }

    fn class_of(&self, value: Value) -> Result<Class, SceneError> {
        match self.heap.get(value) {
            Some(Node::Class(class)) => Ok(*class),
            _ => Err(broken(format!("{} called as a function", self.heap.describe(value)))),
        }
    }

    fn construct(&mut self, class: Class, arguments: &[Value]) -> Result<(), SceneError> {
        let value = construct::object(&mut self.heap, class, arguments)?;
        self.number(value)
    }

    /// `BUILD`: the state of the object below it.
    fn build(&mut self) -> Result<(), SceneError> {
        let state = self.pop()?;
        let object = self.top()?;
        construct::set_state(&mut self.heap, object, state)?;
        if let Some(Node::Instance { class: Class::JoblibArray, .. }) = self.heap.get(object) {
            let array = construct::joblib_array(&mut self.heap, &mut self.input, state)?;
            self.pop()?;
            self.number(array)?;
        }
        Ok(())
    }
}

/// Keys and values that follow one another.
fn pairs(values: &[Value]) -> Result<Vec<(Value, Value)>, SceneError> {
    if !values.len().is_multiple_of(2) {
        return Err(broken("a key without a value"));
    }
    Ok(values.chunks_exact(2).map(|pair| (pair[0], pair[1])).collect())
}

/// A little-endian integer in two's complement, if it fits.
fn long(bytes: &[u8]) -> Option<Value> {
    let fill = if bytes.last().is_some_and(|b| b & 0x80 != 0) { 0xff } else { 0 };
    let (low, high) = bytes.split_at(bytes.len().min(8));
    if high.iter().any(|&b| b != fill) || (!high.is_empty() && (low[7] ^ fill) & 0x80 != 0) {
        return None;
    }
    let number: [u8; 8] = std::array::from_fn(|i| low.get(i).copied().unwrap_or(fill));
    Some(Value::Int(i64::from_le_bytes(number)))
}

/// `INT` and `LONG` of protocol 0. `I00` and `I01` are booleans.
fn whole(line: &str, booleans: bool) -> Result<Option<Value>, SceneError> {
    let text = line.trim();
    if booleans && matches!(text, "00" | "01") {
        return Ok(Some(Value::Bool(text == "01")));
    }
    let digits = text.trim_end_matches('L');
    if let Ok(number) = digits.parse() {
        return Ok(Some(Value::Int(number)));
    }
    let unsigned = digits.trim_start_matches(['-', '+']);
    match !unsigned.is_empty() && unsigned.bytes().all(|b| b.is_ascii_digit()) {
        true => Ok(None),
        false => Err(broken(format!("{:?} as an integer", text.chars().take(40).collect::<String>()))),
    }
}
