use super::*;
use crate::catalogue;

fn dictionary(name: &str) -> Dictionary {
    Dictionary::new(&catalogue::by_name(name).unwrap())
}

#[test]
fn standard_objects_follow_from_the_description() {
    let dictionary = dictionary("servo");
    for index in [0x1000, 0x1001, 0x1008, 0x1009, 0x100A, 0x1018, 0x1C00, 0x1C12, 0x1C13, 0x1600, 0x1A00, 0x6040] {
        assert!(dictionary.object(index).is_some(), "{index:#06x}");
    }
    let types: Vec<u8> = (1..=4).map(|sub_index| dictionary.read(0x1C00, sub_index).unwrap()[0]).collect();
    assert_eq!(types, [1, 2, 3, 4]);
    assert_eq!((dictionary.assigned_bits(2), dictionary.assigned_bits(3)), (96, 112));
}

#[test]
fn a_list_contains_only_assigned_pdos() {
    let dictionary = dictionary("analog-input-4");
    assert_eq!(dictionary.assigned(3).collect::<Vec<_>>(), [0x1A00, 0x1A02, 0x1A04, 0x1A06]);
    let expected = [4, 0, 0x00, 0x1A, 0x02, 0x1A, 0x04, 0x1A, 0x06, 0x1A];
    assert_eq!(dictionary.read_complete(0x1C13, 0).unwrap(), expected);
    assert_eq!(dictionary.read_complete(0x1C13, 1).unwrap(), expected[2..]);
}

#[test]
fn a_terminal_without_mailbox_has_its_process_data_in_the_dictionary() {
    let dictionary = dictionary("digital-output-16");
    assert_eq!(dictionary.assigned_bits(0), 16);
    assert_eq!(dictionary.mapped(0x160F).next().unwrap().index, 0x70F0);
}

#[test]
fn fixed_lists_cannot_be_written() {
    let mut dictionary = dictionary("analog-input-4");
    assert_eq!(dictionary.write(0x1A00, 0, &[0], AlState::PreOp), Err(AbortCode::READ_ONLY));
}

#[test]
fn complete_access_to_a_record_writes_entry_by_entry() {
    let mut dictionary = dictionary("analog-input-4");
    let mut data = vec![0x34, 0x12];
    data.extend_from_slice(&70_000u32.to_le_bytes());
    data.extend_from_slice(b"complete record!");
    dictionary.write_complete(0x8000, 1, &data, AlState::PreOp).unwrap();
    assert_eq!(dictionary.read_complete(0x8000, 1).unwrap(), data);
    assert_eq!(dictionary.write_complete(0x8000, 1, &data[..5], AlState::PreOp), Err(AbortCode::LENGTH_TOO_SHORT));
    data.push(0);
    assert_eq!(dictionary.write_complete(0x8000, 1, &data, AlState::PreOp), Err(AbortCode::LENGTH_TOO_LONG));
    assert_eq!(dictionary.write_complete(0x5555, 1, &data, AlState::PreOp), Err(AbortCode::OBJECT_DOES_NOT_EXIST));
}

#[test]
fn values_set_from_inside_keep_their_length() {
    let mut dictionary = dictionary("servo");
    dictionary.set(0x1001, 0, &[0x81, 0x55]);
    assert_eq!(dictionary.read(0x1001, 0), Ok(&[0x81][..]));
}
